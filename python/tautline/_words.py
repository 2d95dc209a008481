"""Words that arguments take, so that type checkers find a wrong one. A test compares them with the native module."""

from __future__ import annotations

from typing import Literal

Motion = Literal["linear", "hold", "polynomial", "bounded"]
PlanEnd = Literal["hold", "continue", "unknown"]
Rules = Literal["recording", "skybrush", "none"]
Verdict = Literal["pass", "clear", "reached"]
Duplicates = Literal["first", "last", "refuse"]
MessageClock = Literal["stamp", "log"]
TimeUnit = Literal["s", "ms", "us", "ns"]
ReadFormat = Literal[
    "ulog",
    "parquet",
    "mcap",
    "npz",
    "skyb",
    "jsonl",
    "skybrush",
    "crazyflie-compressed",
    "motive",
    "vicon",
    "bezier",
    "crazyflie",
    "csv",
    "trajnet",
    "text",
]
ExportFormat = Literal["csv", "parquet", "npz", "mcap", "crazyflie", "skyb", "skyc"]
Reaches = Literal["places", "displacements", "distances"]
