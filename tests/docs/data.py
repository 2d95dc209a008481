"""Checks blocks that are files: the program reads scenarios, campaigns and obstacles, others are parsed."""

from __future__ import annotations

import json
import shlex
import tomllib
from pathlib import Path
from typing import Any

from commands import run, spoken, unknown_arguments
from pages import ROOT, Block

WRONG_INPUT = 2

# First key of a file for `tautline audit`, and its option.
AUDIT_FILES = {"obstacle": "--obstacles", "fence": "--fence", "audit": "--config"}

TWO = "t_s,id,x,y,z\n0,a,100,100,100\n0,b,110,100,100\n1,a,100,100,100\n1,b,110,100,100\n"


def wrong_data(block: Block, folder: Path, programs: Path) -> list[str]:
    """Returns the errors of a block that is not a command."""
    try:
        if block.language == "toml":
            return wrong_toml(block, folder, programs)
        if block.language == "json":
            json.loads(block.text)
        elif block.language == "yaml":
            return wrong_yaml(block)
        elif block.language == "python":
            compile(block.text, block.place, "exec")
        elif block.language == "rust":
            return wrong_excerpt(block)
    except (ValueError, SyntaxError) as error:
        return [f"{block.place}: {error}"]
    known = ("toml", "json", "yaml", "python", "rust", "csv", "")
    return [] if block.language in known else [f"{block.place}: no test for blocks of `{block.language}`"]


def wrong_toml(block: Block, folder: Path, programs: Path) -> list[str]:
    keys = tomllib.loads(block.text)
    if block.name == "Cargo.toml":
        return wrong_features(block, keys)
    path = folder / Path(block.name or f"block-{block.line}.toml").name
    path.write_text(block.text + "\n", encoding="utf-8")
    file = shlex.quote(path.name)
    if {"start", "formation", "time"} <= keys.keys():
        command = f"tautline check {file}"
    elif "scenario" in keys:
        command = f"tautline campaign plan {file} --out plan-{block.line}"
    elif len(keys) == 1 and keys.keys() <= AUDIT_FILES.keys():
        (folder / "two.csv").write_text(TWO, encoding="utf-8")
        command = f"tautline audit two.csv --delta 0.5 {' '.join(AUDIT_FILES[key] for key in keys)} {file}"
    else:
        command = f"tautline check pentagon {' '.join(f'--set {shlex.quote(one)}' for one in settings(keys))}"
    ran = run(command, folder, programs)
    wrong = ran.exit_code >= WRONG_INPUT
    return [f"{block.place}: {command}\n{ran.output.strip()}"] if wrong else []


def wrong_features(block: Block, keys: dict[str, Any]) -> list[str]:
    """Returns the errors of a Cargo.toml that depends on crates of this workspace at `../tautline`."""
    wrong = []
    for name, asked in keys["dependencies"].items():
        manifest = ROOT / Path(asked["path"]).relative_to("../tautline") / "Cargo.toml"
        ours = tomllib.loads(manifest.read_text(encoding="utf-8")) if manifest.exists() else {}
        if ours.get("package", {}).get("name") != name:
            wrong.append(f"{block.place}: there is no crate {name} at {asked['path']}")
        known = ours.get("features", {})
        missing = [feature for feature in asked.get("features", []) if feature not in known]
        wrong += [f"{block.place}: {name} has no feature {feature}" for feature in missing]
    return wrong


def settings(table: dict[str, Any], path: str = "") -> list[str]:
    """Returns a value of `--set` for each key of a table."""
    made = []
    for key, value in table.items():
        place = f"{path}.{key}" if path else key
        if isinstance(value, dict) and place != "laws":
            made += settings(value, place)
        else:
            made.append(f"{place}={inline(value)}")
    return made


def inline(value: Any) -> str:
    """Returns a value as TOML in one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {inline(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(inline(one) for one in value) + "]"
    return json.dumps(value)


def wrong_yaml(block: Block) -> list[str]:
    import yaml  # installed for the tests of clusters

    try:
        yaml.safe_load(block.text)
    except yaml.YAMLError as error:
        return [f"{block.place}: {error}"]
    return [f"{block.place}: {one}" for arguments in spoken(block.text) for one in unknown_arguments(arguments)]


def wrong_excerpt(block: Block) -> list[str]:
    """Returns an error for each part of a Rust block that its file does not have. `// ...` stands for omitted code."""
    if not block.name:
        return [f"{block.place}: the first line must name the source of the code: // examples/own_law.rs"]
    source = (ROOT / block.name).read_text(encoding="utf-8")
    parts = block.text.split("\n", 1)[1].split("// ...\n")
    return [f"{block.place}: {block.name} does not have\n{part}" for part in parts if part.strip("\n") not in source]
