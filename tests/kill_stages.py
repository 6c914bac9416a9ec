#!/usr/bin/env python3
"""Kills each stage at random moments, continues it, and compares what it leaves with an undisturbed run.

    tests/kill_stages.py BIN_FOLDER PICTURES WORK_FOLDER --kills 200

A stage is killed, with all that it started, once or several times, until it has had that many kills in all; after each series
the same command must end with exit code 0 and leave the files of the undisturbed stage, byte for byte, and no others. Prints
a line per stage; exit code 1 when something differed.
"""
import argparse
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import time

from rank_faults import TIMED, digest

STAGES = ("ingest", "sfm", "normalize", "train", "evaluate", "render", "report")


def words(given, stage, run):
    """The command of a stage, with the options of `pipeline run` that concern it."""
    of_stage = {"train": ["--steps=150"], "render": ["--frames=8"], "normalize": ["--image-size=160"]}
    positional = [given.pictures] if stage == "ingest" else []
    return [given.bin / f"pipeline-{stage}", *positional, "--out", run, "--threads=1", *of_stage.get(stage, [])]


def start(given, stage, run):
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen(words(given, stage, run), start_new_session=True, **quiet)


def files(run):
    """All names in the run folder, and the bytes of those without times in them."""
    found = {}
    for path in sorted(run.rglob("*")):
        name = str(path.relative_to(run))
        record = path.suffix == ".json" and path.stem == path.parent.name
        timed = name in TIMED or record or name in ("run.json", "report.html", ".stage.lock")
        found[name] = digest(path) if path.is_file() and not timed else None
    return found


def kill_once(given, stage, run, length_s):
    process = start(given, stage, run)
    time.sleep(random.uniform(0, length_s))
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
    return process.wait() == -signal.SIGKILL


def try_stage(given, stage, before, after):
    """Kills that met the stage at work, and what differed."""
    run, met, differed = given.work / "run", 0, []
    expected = files(after)
    began = time.time()
    reset(run, before)
    start(given, stage, run).wait()
    length_s = time.time() - began
    for _ in range(10 * given.kills):
        if met >= given.kills:
            break
        reset(run, before)
        for _ in range(random.choice((1, 1, 2, 3))):
            met += kill_once(given, stage, run, length_s)
        code = start(given, stage, run).wait()
        found = files(run)
        names = [name for name in sorted(found | expected) if found.get(name, 0) != expected.get(name, 0)]
        if code != 0 or names:
            differed.append(f"exit code {code}, {names[:5]}")
            shutil.copytree(run, given.work / f"{stage}{len(differed)}", dirs_exist_ok=True)
    return met, differed


def reset(run, before):
    shutil.rmtree(run, ignore_errors=True)
    shutil.copytree(before, run)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("pictures", type=pathlib.Path)
    parser.add_argument("work", type=pathlib.Path)
    parser.add_argument("--kills", type=int, default=5, help="per stage")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    random.seed(given.seed)
    before, after = given.work / "before", given.work / "after"
    shutil.rmtree(given.work, ignore_errors=True)
    before.mkdir(parents=True)
    wrong = 0
    for stage in STAGES:
        # All work in one place, whose name may be part of what they write.
        run = given.work / "run"
        reset(run, before)
        if start(given, stage, run).wait() != 0:
            sys.exit(f"{stage} fails undisturbed")
        reset(after, run)
        met, differed = try_stage(given, stage, before, after)
        wrong += len(differed)
        print(f"{stage}: {met} kills, {len(differed)} left other files", *differed, flush=True)
        reset(before, after)
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
