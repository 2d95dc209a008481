"""Flies the missing shards of a campaign on a Ray cluster: ``python tautline_ray.py camp/``.

Every node needs the same program, and the campaign's folder under the same path. After an interruption the same command
continues. docs/clusters.md shows how to start a cluster.
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
    """Runs ``tautline campaign VERB camp`` to its end and captures its output."""
    return subprocess.run([program, "campaign", verb, str(camp), *more], capture_output=True, text=True, check=False)


def missing(program: str, camp: Path) -> list[int]:
    """Returns the missing shards in order. Exits with 2 or 3 where the program fails."""
    listed = tautline(program, "missing", camp)
    if listed.returncode not in (0, 1):
        print(listed.stderr, file=sys.stderr, end="")
        raise SystemExit(2 if listed.returncode == 2 else 3)
    spans = [span.split("-") for span in listed.stdout.strip().split(",") if span]
    return [shard for span in spans for shard in range(int(span[0]), int(span[-1]) + 1)]


def fly(program: str, camp: Path, shard: int, threads: int) -> tuple[float, str]:
    """Flies a shard. Returns its duration [s] and an error of the input, or "". Raises where a retry may help."""
    began = time.monotonic()
    flown = tautline(program, "shard", camp, "--shard", str(shard), "--threads", str(threads), "--quiet")
    message = f"shard {shard} on {os.uname().nodename}: exit code {flown.returncode}\n{flown.stderr}"
    if flown.returncode not in (0, 2):
        raise RuntimeError(message)
    return time.monotonic() - began, message if flown.returncode == 2 else ""


def fly_all(program: str, camp: Path, shards: list[int], threads: int = 1, hedge_after_s: float = 10.0) -> int:
    """Flies ``shards`` on the cluster that Ray is connected to. Returns 0, or prints the reason and returns 2 or 3.

    A shard is submitted again after the larger of ``hedge_after_s`` and three times the slowest shard so far. Further
    attempts follow if needed, because a frozen node never returns its tasks. The first attempt that ends counts.
    """
    ray.cloudpickle.register_pickle_by_value(sys.modules[__name__])  # Nodes do not need this file.
    task = ray.remote(num_cpus=threads, max_retries=5, retry_exceptions=True)(fly)
    waiting, began, reported = shards[::-1], time.monotonic(), -10.0
    attempts: dict[ray.ObjectRef[tuple[float, str]], int] = {}  # Running attempts with their shards.
    submitted: dict[int, list[float]] = {}  # Unfinished shards with the times of their submissions.
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
            # The patience grows with each attempt: otherwise a long queue would grow without end.
            if done and now - times[-1] > max(hedge_after_s, 3.0 * slowest_s) * len(times):
                submit(shard)
                hedged += 1
        if now - reported >= 10.0 or not left:
            reported, minutes = now, (now - began) / max(done, 1) * left / 60.0
            time_left = f", {minutes:.1f} min left" if done and left else ""
            progress = f"{done} of {len(shards)} shards, {slots} slots, {hedged} submitted again{time_left}"
            print(progress, file=sys.stderr)
    return 3 if failed else 0


def main() -> int:
    """Runs the command line. Returns 0 if no shard is missing, 2 for wrong input, 3 if shards are missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("camp", type=Path, help="folder of the campaign, from tautline campaign plan")
    parser.add_argument("--address", default="auto", help="HOST:PORT of the cluster, or local [this machine's cluster]")
    parser.add_argument("--tautline", default="tautline", metavar="PATH", help="path of the program on all nodes")
    parser.add_argument("--threads", type=int, default=1, metavar="N", help="threads of a shard, by default 1")
    parser.add_argument(
        "--hedge-after", type=float, default=10.0, metavar="S", help="shortest time before another attempt [s]"
    )
    options = parser.parse_args()
    program, camp = shutil.which(options.tautline), options.camp.resolve()
    if program is None:
        parser.error(f"--tautline: there is no program {options.tautline}; give its path")
    if options.threads < 1:
        parser.error(f"--threads: must be at least 1, got {options.threads}")
    program = os.path.abspath(program)
    shards = missing(program, camp)
    if shards:
        try:
            ray.init(address=options.address, log_to_driver=False, logging_level=logging.WARNING)
        except (ConnectionError, ValueError) as error:
            print(f"{error}; start a cluster (docs/clusters.md), or give --address local", file=sys.stderr)
            return 3
        try:
            code = fly_all(program, camp, shards, options.threads, options.hedge_after)
        except KeyboardInterrupt:
            print("interrupted; the flown shards are kept, and the same command continues", file=sys.stderr)
            return 3
        finally:
            ray.shutdown()
        return code or (3 if missing(program, camp) else 0)
    return 0


if __name__ == "__main__":
    sys.exit(main())
