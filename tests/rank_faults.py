#!/usr/bin/env python3
"""Kills, stops and cuts off ranks of `pipeline run` at random moments, and continues each run to its end.

    tests/rank_faults.py BIN_FOLDER PICTURES WORK_FOLDER --kills 50 --stops 20 --cuts 20

One run on one rank tells what must come out. Then two ranks start in network namespaces of their own, joined by a virtual
link (needs root). At a random moment one rank gets SIGKILL or SIGSTOP, or the link goes down. The other must end within
30 s with exit code 11 and a line that names a rank; one, two or three ranks then continue, and must leave the bytes of the first
run. Prints a line per fault, then the counts; exit code 1 when one was not met.
"""
import argparse
import hashlib
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import time

OPTIONS = ["--steps=150", "--frames-out=8", "--image-size=160", "--threads=1"]
ADDRESS = "10.77.0.1"
MOST_S = 30  # until the others have ended
JOIN_S = 20  # that a rank waits for one that was killed before they met
LOST_RANK = 11
# Products with times in them.
TIMED = {"sfm/colmap.log", "train/checkpoint.bin", "train/curve.csv"}


def ip(*words):
    subprocess.run(["ip", *words], check=True)


class Network:
    """Two hosts, rank0 and rank1, on one link."""

    def __enter__(self):
        self.__exit__()
        for host in (0, 1):
            ip("netns", "add", f"rank{host}")
        ip("link", "add", "link0", "netns", "rank0", "type", "veth", "peer", "name", "link1", "netns", "rank1")
        for host in (0, 1):
            inside = ("-n", f"rank{host}")
            ip(*inside, "addr", "add", f"10.77.0.{host + 1}/24", "dev", f"link{host}")
            ip(*inside, "link", "set", "lo", "up")
            ip(*inside, "link", "set", f"link{host}", "up")
        return self

    def __exit__(self, *_):
        for host in (0, 1):
            subprocess.run(["ip", "netns", "del", f"rank{host}"], stderr=subprocess.DEVNULL)

    def set_link(self, state):
        ip("-n", "rank0", "link", "set", "link0", state)


class Ranks:
    """`pipeline run` on n ranks, each the leader of a process group."""

    def __init__(self, given, run, n):
        self.logs = [run.with_suffix(f".log{r}") for r in range(n)]
        port = str(random.randrange(20000, 60000))
        self.processes = []
        for r in range(n):
            environment = dict(os.environ, RANK=str(r), WORLD_SIZE=str(n), MASTER_ADDR=ADDRESS, MASTER_PORT=port)
            environment["PIPELINE_JOIN_S"] = str(JOIN_S)
            command = [given.bin / "pipeline", "run", given.pictures, "--out", run, *OPTIONS]
            host = ["ip", "netns", "exec", f"rank{r % 2}"]
            self.processes.append(
                subprocess.Popen(
                    [*host, *command],
                    env=environment,
                    stdout=open(self.logs[r], "wb"),
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )
            )

    def send(self, rank, what):
        try:
            os.killpg(self.processes[rank].pid, what)
        except ProcessLookupError:
            pass

    def wait(self, rank, seconds):
        try:
            return self.processes[rank].wait(seconds)
        except subprocess.TimeoutExpired:
            return None

    def end(self):
        for rank, process in enumerate(self.processes):
            self.send(rank, signal.SIGKILL)
            process.wait()


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def products(run):
    """Digests of what stages wrote; those without times."""
    digests = {}
    for folder in ("ingest", "sfm", "scene", "train", "evaluate", "render"):
        for path in sorted((run / folder).rglob("*")):
            name = str(path.relative_to(run))
            if path.is_file() and name not in TIMED and path != run / folder / f"{folder}.json":
                digests[name] = digest(path)
    return digests


def try_fault(given, fault, network, run, expected, length_s):
    """What went wrong, or nothing."""
    shutil.rmtree(run, ignore_errors=True)
    ranks = Ranks(given, run, 2)
    rank, moment = random.randrange(2), random.uniform(0.2, 0.9 * length_s)
    time.sleep(moment)
    began, others = time.time(), [1 - rank]
    if fault == "cut":
        network.set_link("down")
        others = [0, 1]
    else:
        ranks.send(rank, signal.SIGKILL if fault == "kill" else signal.SIGSTOP)
    codes = [ranks.wait(r, MOST_S - (time.time() - began)) for r in others]
    took_s = time.time() - began
    ranks.end()
    if fault == "cut":
        network.set_link("up")
    said = [ranks.logs[r].read_text(errors="replace").strip().rsplit("\n", 1)[-1] for r in others]
    n = random.choice((1, 2, 3))
    print(f"{fault} of rank {rank} after {moment:.1f} s: {codes} in {took_s:.1f} s; continued by {n}: {said[0]}", flush=True)
    if any(code != 0 and (code != LOST_RANK or "rank" not in line) for code, line in zip(codes, said)):
        return f"exit codes {codes}, {said}"
    again = Ranks(given, run, n)
    codes = [again.wait(r, 600) for r in range(n)]
    again.end()
    if any(codes):
        return f"continued with exit codes {codes}: {again.logs[0].read_text(errors='replace')[-500:]}"
    found = products(run)
    differing = [name for name in sorted(found | expected) if found.get(name) != expected.get(name)]
    return f"other bytes: {differing[:5]}" if differing else None


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("pictures", type=pathlib.Path)
    parser.add_argument("work", type=pathlib.Path)
    for fault in ("kills", "stops", "cuts"):
        parser.add_argument(f"--{fault}", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    random.seed(given.seed)
    given.work.mkdir(parents=True, exist_ok=True)
    with Network() as network:
        shutil.rmtree(given.work / "one", ignore_errors=True)
        Ranks(given, given.work / "one", 1).wait(0, 600)
        expected = products(given.work / "one")
        began = time.time()
        shutil.rmtree(given.work / "two", ignore_errors=True)
        straight = Ranks(given, given.work / "two", 2)
        codes = [straight.wait(r, 600) for r in (0, 1)]
        length_s = time.time() - began
        print(f"{len(expected)} products; two ranks: {codes} in {length_s:.1f} s", flush=True)
        if any(codes) or not expected or products(given.work / "two") != expected:
            sys.exit("two ranks do not write what one does")
        unmet = 0
        for fault, count in (("kill", given.kills), ("stop", given.stops), ("cut", given.cuts)):
            for i in range(count):
                wrong = try_fault(given, fault, network, given.work / "run", expected, length_s)
                if wrong:
                    unmet += 1
                    print(f"{fault} {i}: NOT MET: {wrong}", flush=True)
        print(f"{given.kills} kills, {given.stops} stops, {given.cuts} cuts: {unmet} not met")
        sys.exit(unmet > 0)


if __name__ == "__main__":
    main()
