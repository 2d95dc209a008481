"""Flies what is missing of a campaign on a Ray cluster: ``python tautline_ray.py camp/``.

Every node needs the same program and sees the campaign's folder under the same path. Given again after whatever stopped it,
the command goes on. docs/clusters.md says how to start a cluster.
"""

from __future__ import annotations

import argparse
import logging
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import ray


def tautline(program: str, verb: str, camp: Path, *more: str) -> subprocess.CompletedProcess[str]:
    """Runs ``tautline campaign VERB camp`` to its end and keeps what it says."""
    return subprocess.run([program, "campaign", verb, str(camp), *more], capture_output=True, text=True, check=False)


def missing(program: str, camp: Path) -> list[int]:
    """Shards that are not flown, in order; exits with 2 or 3 where the program says that something is wrong."""
    asked = tautline(program, "missing", camp)
    if asked.returncode not in (0, 1):
        print(asked.stderr, file=sys.stderr, end="")
        raise SystemExit(2 if asked.returncode == 2 else 3)
    spans = [span.split("-") for span in asked.stdout.strip().split(",") if span]
    return [shard for span in spans for shard in range(int(span[0]), int(span[-1]) + 1)]


def fly(program: str, camp: Path, shard: int, threads: int) -> tuple[float, str]:
    """Flies a shard: seconds that it took, and what is wrong with the input, if anything; raises where a retry may help."""
    began = time.monotonic()
    flown = tautline(program, "shard", camp, "--shard", str(shard), "--threads", str(threads), "--quiet")
    said = f"shard {shard} on {os.uname().nodename}: exit code {flown.returncode}\n{flown.stderr}"
    if flown.returncode not in (0, 2):
        raise RuntimeError(said)
    return time.monotonic() - began, said if flown.returncode == 2 else ""


def fly_all(program: str, camp: Path, shards: list[int], threads: int = 1, hedge_after_s: float = 10.0) -> int:
    """Flies ``shards`` on the cluster that Ray is connected to: 0 once each is done, else 2 or 3, and the reason is printed.

    A shard that is not done after ``hedge_after_s`` seconds and three times the slowest one so far is submitted once more,
    and again where that does not help: a frozen node keeps for ever what it has and what Ray sends it next. The first
    attempt to end counts, and nobody waits for the others.
    """
    ray.cloudpickle.register_pickle_by_value(sys.modules[__name__])  # Nodes need not have this file.
    task = ray.remote(num_cpus=threads, max_retries=5, retry_exceptions=True)(fly)
    waiting, began, said = shards[::-1], time.monotonic(), -10.0
    attempts: dict[ray.ObjectRef[tuple[float, str]], int] = {}  # under way, each with its shard
    submitted: dict[int, list[float]] = {}  # shards that are not done, and when each was submitted
    done = failed = hedged = 0
    slowest_s = 0.0

    def submit(shard: int) -> None:
        submitted.setdefault(shard, []).append(time.monotonic())
        attempts[task.remote(program, camp, shard, threads)] = shard

    while waiting or submitted:
        slots = max(1, int(ray.cluster_resources().get("CPU", 0)) // threads)
        while waiting and len(submitted) < 2 * slots:
            submit(waiting.pop())
        for attempt in ray.wait(list(attempts), timeout=1.0)[0]:
            shard = attempts.pop(attempt)
            try:
                took_s, wrong = ray.get(attempt)
            except ray.exceptions.RayError as error:
                if shard in submitted and shard not in attempts.values():
                    print(getattr(error, "cause", error), file=sys.stderr)
                    del submitted[shard]
                    failed += 1
                continue
            if wrong:
                print(wrong, file=sys.stderr)
                return 2
            if submitted.pop(shard, None):
                slowest_s = max(slowest_s, took_s)
                done += 1
        now, left = time.monotonic(), len(shards) - done - failed
        for shard, times in list(submitted.items()):
            # Each attempt has longer than the one before, so that a long queue does not grow for ever.
            if done and now - times[-1] > max(hedge_after_s, 3.0 * slowest_s) * len(times):
                submit(shard)
                hedged += 1
        if now - said >= 10.0 or not left:
            said, minutes = now, (now - began) / max(done, 1) * left / 60.0
            time_left = f", {minutes:.1f} min left" if done and left else ""
            print(f"{done} of {len(shards)} shards, {slots} slots, {hedged} submitted again{time_left}", file=sys.stderr)
    return 3 if failed else 0


def main() -> int:
    """Reads the command line: 0 once nothing is missing, 2 for wrong input, 3 where shards stayed missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("camp", type=Path, help="the folder of the campaign, from tautline campaign plan")
    parser.add_argument("--address", default="auto", help="HOST:PORT of the cluster, or local; by default this machine's")
    parser.add_argument("--tautline", default="tautline", metavar="PATH", help="the program, as every node finds it")
    parser.add_argument("--threads", type=int, default=1, metavar="N", help="threads a shard, by default 1")
    parser.add_argument("--hedge-after", type=float, default=10.0, metavar="S", help="seconds a slow shard has, at least")
    asked = parser.parse_args()
    program, camp = shutil.which(asked.tautline), asked.camp.resolve()
    if program is None:
        parser.error(f"there is no program {asked.tautline}: give its place with --tautline")
    if asked.threads < 1:
        parser.error("--threads is 1 at least")
    program = os.path.abspath(program)
    shards = missing(program, camp)
    if shards:
        try:
            ray.init(address=asked.address, log_to_driver=False, logging_level=logging.WARNING)
        except (ConnectionError, ValueError) as error:
            print(f"{error}\nstart a cluster as docs/clusters.md shows, or give --address local", file=sys.stderr)
            return 3
        try:
            code = fly_all(program, camp, shards, asked.threads, asked.hedge_after)
        except KeyboardInterrupt:
            print("interrupted: what was flown is kept, and the same command goes on", file=sys.stderr)
            return 3
        finally:
            ray.shutdown()
        return code or (3 if missing(program, camp) else 0)
    return 0


if __name__ == "__main__":
    sys.exit(main())
