"""Nodes of Ray on this machine, each with its own daemons, as `ray start` starts them on machines of their own."""

from __future__ import annotations

import os
import secrets
import signal
import socket
import subprocess
import sys
from pathlib import Path

from campaigns import children, end, until, words

RAY = Path(sys.executable).with_name("ray")
# Whoever reaches the ports of a cluster can run programs: only these tests know the token of theirs.
TOKEN = {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(32)}
ENVIRONMENT = {**os.environ, **TOKEN, "RAY_USAGE_STATS_ENABLED": "0"}


def free_port() -> int:
    """A port that nobody listens at."""
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        return listening.getsockname()[1]


class Node:
    """A node with one slot."""

    def __init__(self, folder: Path, name: str, head: Node | None = None) -> None:
        """Begins to start a node: the head of a cluster, or one that joins ``head``'s."""
        self.address: str = head.address if head else f"127.0.0.1:{free_port()}"
        self.log = folder / f"{name}.log"
        role = ["--address", self.address] if head else [
            "--head", "--port", self.address.split(":")[1], "--include-dashboard", "false", "--temp-dir", folder / "ray",
        ]
        # Every port is free to choose: the defaults are the same for all nodes, and these share a machine.
        ports = ["--min-worker-port", 0, "--max-worker-port", 0, "--dashboard-agent-listen-port", 0]
        sizes = ["--num-cpus", 1, "--object-store-memory", 80_000_000, "--include-log-monitor", "false"]
        words = ["start", "--block", "--node-ip-address", "127.0.0.1", *role, *ports, *sizes]
        with self.log.open("wb") as log:
            self.daemon = subprocess.Popen(
                [RAY, *map(str, words)], stdout=log, stderr=log, env=ENVIRONMENT, start_new_session=True, cwd=folder
            )

    def ready(self) -> Node:
        """Waits until it has joined."""
        until(lambda: "Ray runtime started" in self.log.read_text() or self.daemon.poll() is not None, 90, "no node of Ray")
        assert self.daemon.poll() is None, self.log.read_text()
        return self

    def workers(self) -> list[int]:
        """Processes that fly a shard just now."""
        return [process for process in children(self.daemon.pid) if words(process).startswith("ray::fly")]

    def flights(self) -> list[int]:
        """Processes of the program that this node runs just now."""
        return [process for process in children(self.daemon.pid) if " campaign shard " in words(process)]

    def freeze(self) -> list[int]:
        """Freezes all its processes, amid a flight; gives those of the program."""
        frozen: list[int] = []

        def frozen_in_flight() -> bool:
            for process in frozen:
                self.signal(process, signal.SIGCONT)
            frozen[:] = children(self.daemon.pid)
            for process in frozen:
                self.signal(process, signal.SIGSTOP)
            return bool(self.flights()) and set(children(self.daemon.pid)) == set(frozen)

        until(frozen_in_flight, 30, "nothing flew on the node that was to be frozen")
        return self.flights()

    @staticmethod
    def signal(process: int, number: int) -> None:
        """Signals a process that may have ended."""
        try:
            os.kill(process, number)
        except ProcessLookupError:
            pass

    def end(self) -> None:
        """Ends it, frozen or not, and nothing else."""
        end(children(self.daemon.pid))
        self.daemon.wait()
