#!/usr/bin/env python3
"""Disables the guards of a source file one by one and lists those that no test misses.

    tests/mutate_guards.py BUILD_FOLDER TEST_PROGRAM SOURCE...

A guard is an `if` whose statement throws or refuses. Each is made to hold never, TEST_PROGRAM is built and run, and the
source is put back. Run it on a copy of the tree: it edits sources, and takes a compilation for each guard.
"""
import pathlib
import re
import subprocess
import sys

REFUSALS = re.compile(
    r"\s*\{?\s*(?:throw\b|[Rr]efuse\w*\(|Reject\w*\(|Fail\w*\(|[\w.(\")]*\.Fail\(|return\s+(?:Refus|Reject)\w*)"
)


def closing(text, start):
    """Index behind the parenthesis that closes the one at `start`."""
    depth = 0
    for i in range(start, len(text)):
        depth += {"(": 1, ")": -1}.get(text[i], 0)
        if depth == 0:
            return i + 1
    raise ValueError("unbalanced parentheses")


def guards(text):
    """Begin and end of the condition of every guard, without its parentheses."""
    for match in re.finditer(r"\bif (?:constexpr )?\(", text):
        end = closing(text, match.end() - 1)
        condition = text[match.end() : end - 1]
        if REFUSALS.match(text[end:]) and ";" not in condition and "=" not in re.sub(r"[=!<>]=", "", condition):
            yield match.end(), end - 1


def outcome(build, program):
    built = subprocess.run(["cmake", "--build", build, "--target", program], capture_output=True)
    if built.returncode != 0:
        return "does not build"
    run = [str(pathlib.Path(build) / "bin" / program), "--gtest_brief=1"]
    try:
        tests = subprocess.run(run, capture_output=True, timeout=600)
    except subprocess.TimeoutExpired:
        return "found"
    return "missed" if tests.returncode == 0 else "found"


def main():
    build, program, *sources = sys.argv[1:]
    counts = {}
    for source in map(pathlib.Path, sources):
        text = source.read_text()
        try:
            for begin, end in list(guards(text)):
                source.write_text(text[:begin] + "false && (" + text[begin:end] + ")" + text[end:])
                result = outcome(build, program)
                counts[result] = counts.get(result, 0) + 1
                line = text.count("\n", 0, begin) + 1
                print(f"{result:15}{source}:{line}: {' '.join(text[begin:end].split())}", flush=True)
        finally:
            source.write_text(text)
    print(", ".join(f"{n} {result}" for result, n in counts.items()))


if __name__ == "__main__":
    main()
