"""A Slurm cluster with this machine as its only node, and its own daemons, ports, keys and folders."""

from __future__ import annotations

import os
import pwd
import secrets
import socket
import subprocess
from pathlib import Path

from campaigns import children, end, ran, until
from ray_node import free_port

CONFIGURATION = """\
ClusterName=tautline
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller}
SlurmdPort={node}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge/socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
ReturnToService=2
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
SchedulerParameters=sched_interval=1,sched_min_interval=0
MaxArraySize={most}
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


class Slurm:
    """A cluster whose arrays have at most ``most`` tasks."""

    def __init__(self, folder: Path, most: int) -> None:
        """Writes keys and configuration into a folder."""
        self.daemons: list[subprocess.Popen[bytes]] = []
        self.folder = folder
        for name, mode in [("munge", 0o711), ("state", 0o700), ("spool", 0o755)]:
            (folder / name).mkdir()
            (folder / name).chmod(mode)
        folder.chmod(0o755)
        key = folder / "munge" / "key"
        key.write_bytes(secrets.token_bytes(128))
        key.chmod(0o400)
        configuration = folder / "slurm.conf"
        host, user = socket.gethostname().partition(".")[0], pwd.getpwuid(os.getuid()).pw_name
        configuration.write_text(CONFIGURATION.format(
            host=host, user=user, folder=folder, most=most, controller=free_port(), node=free_port()
        ))
        self.environment = {**os.environ, "SLURM_CONF": str(configuration)}
        self.environment["PATH"] += ":/usr/sbin"

    def start(self) -> None:
        """Starts the daemons and waits until the node takes jobs."""
        munge = self.folder / "munge"
        files = {"socket": "socket", "key-file": "key", "pid-file": "pid", "log-file": "log", "seed-file": "seed"}
        # --force, because the folders are in /tmp, to which all users can write.
        self.daemon("munged", "--foreground", "--force", *(f"--{name}={munge / file}" for name, file in files.items()))
        until((munge / "socket").exists, 20, "munged does not start")
        self.daemon("slurmctld", "-D")
        self.daemon("slurmd", "-D")
        until(lambda: self.output("sinfo", "--noheader", "--format=%t") == "idle", 60, "no node of Slurm")

    def daemon(self, *command: str) -> None:
        """Starts a daemon in the foreground."""
        with (self.folder / f"{command[0]}.log").open("wb") as log:
            daemon = subprocess.Popen(command, stdout=log, stderr=log, env=self.environment, start_new_session=True)
        self.daemons.append(daemon)

    def output(self, *command: str | Path) -> str:
        """Returns the output of a command of Slurm; empty if it fails."""
        return ran(*command, env=self.environment).stdout.strip()

    def is_empty(self) -> bool:
        """Returns whether no job is waiting or running."""
        answer = ran("squeue", "--noheader", env=self.environment)
        return answer.returncode == 0 and not answer.stdout.strip()

    def end(self) -> None:
        """Ends the daemons of the cluster."""
        for daemon in reversed(self.daemons):
            started = children(daemon.pid)
            daemon.terminate()
            try:
                daemon.wait(timeout=10)
            except subprocess.TimeoutExpired:
                end(started)
                daemon.wait()
