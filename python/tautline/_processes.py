"""Shards of a campaign in processes of their own: a law in Python holds the lock of its interpreter."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import IO

from ._native import Error

#: Time between two looks at the processes [s].
LOOK_EVERY_S = 0.02
#: Exit code of a failure of the machine.
MACHINE_FAILED = 3


class ShardProcess:
    """Process that flies a shard."""

    def __init__(self, folder: Path, shard: int) -> None:
        self.shard = shard
        self._words: IO[bytes] = tempfile.TemporaryFile()
        program = [sys.executable, "-m", "tautline._shard_process", str(folder.absolute()), str(shard)]
        # The process imports the modules that this one can import.
        modules = os.pathsep.join(str(place) or os.getcwd() for place in sys.path)
        self._process = subprocess.Popen(
            program,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=self._words,
            env={**os.environ, "PYTHONPATH": modules},
            # Ctrl-C is passed on by `ask_to_stop` alone: a second signal would end the flight in progress.
            start_new_session=True,
        )

    def has_ended(self) -> bool:
        """Whether the process has ended. Raises what it printed where it failed: :class:`Error`, or ``OSError`` for a
        failure of the machine."""
        code = self._process.poll()
        if code is None or code == 0:
            return code == 0
        self._words.seek(0)
        words = self._words.read().decode(errors="replace").strip()
        failed = f"shard {self.shard} in a process of its own: {words or f'exit code {code}'}"
        raise OSError(failed) if code == MACHINE_FAILED or code < 0 else Error(failed)

    def ask_to_stop(self) -> None:
        """Asks the process to end after its flight in progress, which is kept."""
        if self._process.stdin is not None:
            self._process.stdin.close()

    def kill(self) -> None:
        """Ends the process at once."""
        self._process.kill()

    def wait(self) -> None:
        """Waits for the end of the process."""
        self._process.wait()
        if self._process.stdin is not None:
            self._process.stdin.close()
        self._words.close()


def fly_shards(
    folder: Path, shards: Iterable[int], processes: int, ended: Callable[[int], None], is_enough: Callable[[], bool]
) -> None:
    """Flies shards, and calls ``ended`` with the number of those that have ended. Begins no further shard once
    ``is_enough``. After an exception all processes end, and finished flights are kept. A second Ctrl-C ends them at
    once."""
    waiting, running, flown = list(shards)[::-1], list[ShardProcess](), 0
    try:
        while waiting or running:
            while waiting and len(running) < processes:
                running.append(ShardProcess(folder, waiting.pop()))
            time.sleep(LOOK_EVERY_S)
            for process in [process for process in running if process.has_ended()]:
                running.remove(process)
                process.wait()
                flown += 1
                ended(flown)
                if waiting and is_enough():
                    waiting.clear()
    finally:
        stop(running)


def stop(running: Iterable[ShardProcess]) -> None:
    """Ends processes after their flights in progress."""
    for process in running:
        process.ask_to_stop()
    try:
        for process in running:
            process.wait()
    except BaseException:
        for process in running:
            process.kill()
        raise
