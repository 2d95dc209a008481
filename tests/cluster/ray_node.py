"""Nodes of Ray on this machine, each with its own daemons, as `ray start` starts them on separate machines."""

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
# The ports of a cluster give access to the machine, so a secret token protects them.
TOKEN = {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(32)}
ENVIRONMENT = {**os.environ, **TOKEN, "RAY_USAGE_STATS_ENABLED": "0"}


def free_port() -> int:
    """Returns an unused port."""
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        return listening.getsockname()[1]


class Node:
    """A node with one slot."""

    def __init__(self, folder: Path, name: str, head: Node | None = None) -> None:
        """Starts the daemon of a node: the head of a cluster, or a node that joins the cluster of ``head``."""
        self.address: str = head.address if head else f"127.0.0.1:{free_port()}"
        self.log = folder / f"{name}.log"
        role = ["--address", self.address] if head else [
            *("--head", "--port", self.address.split(":")[1]),
            *("--include-dashboard", "false", "--temp-dir", folder / "ray"),
        ]
        # Any free ports: the nodes share a machine, and the default ports are the same for all nodes.
        ports = ["--min-worker-port", 0, "--max-worker-port", 0, "--dashboard-agent-listen-port", 0]
        sizes = ["--num-cpus", 1, "--object-store-memory", 80_000_000, "--include-log-monitor", "false"]
        words = ["start", "--block", "--node-ip-address", "127.0.0.1", *role, *ports, *sizes]
        with self.log.open("wb") as log:
            self.daemon = subprocess.Popen(
                [RAY, *map(str, words)], stdout=log, stderr=log, env=ENVIRONMENT, start_new_session=True, cwd=folder
            )

    def ready(self) -> Node:
        """Waits until the node has joined the cluster."""

        def has_started() -> bool:
            return "Ray runtime started" in self.log.read_text() or self.daemon.poll() is not None

        until(has_started, 90, "no node of Ray")
        assert self.daemon.poll() is None, self.log.read_text()
        return self

    def workers(self) -> list[int]:
        """Returns the worker processes that fly a shard."""
        return [process for process in children(self.daemon.pid) if words(process).startswith("ray::fly")]

    def flights(self) -> list[int]:
        """Returns the running processes of the program on this node."""
        return [process for process in children(self.daemon.pid) if " campaign shard " in words(process)]

    def freeze(self) -> list[int]:
        """Stops all processes of the node during a flight; returns those of the program."""
        frozen: list[int] = []

        def frozen_in_flight() -> bool:
            for process in frozen:
                self.signal(process, signal.SIGCONT)
            frozen[:] = children(self.daemon.pid)
            for process in frozen:
                self.signal(process, signal.SIGSTOP)
            return bool(self.flights()) and set(children(self.daemon.pid)) == set(frozen)

        until(frozen_in_flight, 30, "no flight on the node to stop")
        return self.flights()

    @staticmethod
    def signal(process: int, number: int) -> None:
        """Sends a signal to a process that may have ended."""
        try:
            os.kill(process, number)
        except ProcessLookupError:
            pass

    def end(self) -> None:
        """Kills the processes of the node, also stopped ones."""
        end(children(self.daemon.pid))
        self.daemon.wait()
