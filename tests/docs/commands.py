"""Runs the commands of a page, or says what is wrong with those that it does not run."""

from __future__ import annotations

import functools
import os
import re
import shlex
import subprocess
from dataclasses import dataclass
from pathlib import Path

from exceptions import INSTEAD, LONG, NOT_RUN, NOT_RUN_HERE, RUN
from pages import ROOT, Block, Page

TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
TAUTLINE = Path(os.environ.get("TAUTLINE", TARGET / "debug" / "tautline")).resolve()

# Rust programs that cargo starts by name, and where each kind of them lies.
CARGO_TARGETS = {"--example": "examples", "--bench": "benches", "--test": "tests"}

MOST_S = 3600 if os.environ.get("TAUTLINE_LONG") else 170


@dataclass(frozen=True)
class Command:
    """A command of a page."""

    text: str
    place: str
    page: str
    exit_code: int

    @property
    def program(self) -> str:
        words = [word for word in self.text.split() if not re.match(r"[A-Z_]+=", word)]
        return words[0] if words else ""


@dataclass(frozen=True)
class Ran:
    """What came of a command."""

    exit_code: int
    output: str
    """Standard output and behind it standard error."""


def commands(block: Block) -> list[Command]:
    """The commands of a block, with the exit code that a comment on their line says, or 0."""
    made: list[Command] = []
    text, said, begin = "", 0, 0
    for number, line in enumerate(block.text.splitlines(), block.line + 1):
        bare, _, comment = line.partition(" #") if not line.startswith("#") else ("", "", line)
        if not text:
            begin, said = number, 0
        if code := re.search(r"exit code (\d)", comment):
            said = int(code[1])
        text += bare.rstrip().removesuffix("\\").strip() + " "
        if bare.rstrip().endswith("\\"):
            continue
        if text.strip():
            made.append(Command(text.strip(), f"{block.page}:{begin}", block.page, said))
        text = ""
    return made


def as_run(command: Command) -> str | None:
    """The command as the tests run it, or `None` where they do not."""
    text = command.text
    if listed(NOT_RUN_HERE, command) or (listed(LONG, command) and not os.environ.get("TAUTLINE_LONG")):
        return None
    if text in INSTEAD:
        built = TARGET / INSTEAD[text]
        return shlex.quote(str(built)) if built.exists() else None
    if found := re.fullmatch(r"cargo run --release(?: -- (.*))?", text):
        return f"tautline {found[1] or ''}".strip()
    return text if command.program in RUN | {"tautline"} else None


def listed(table: dict[tuple[str, str], str], command: Command) -> bool:
    return any(page == command.page and command.text.startswith(begin) for page, begin in table)


def run(text: str, folder: Path, programs: Path) -> Ran:
    """Runs a command in a folder, with `tautline` found in `programs`."""
    path = os.pathsep.join([str(programs), "/usr/local/bin", "/usr/bin", "/bin"])
    environment = {"PATH": path, "HOME": str(folder), "NO_COLOR": "1", "COLUMNS": "200"}
    try:
        done = subprocess.run(
            ["sh", "-c", text], cwd=folder, env=environment, stdin=subprocess.DEVNULL, capture_output=True, timeout=MOST_S, check=False
        )
    except subprocess.TimeoutExpired:
        return Ran(-1, f"not done after {MOST_S} s: the table LONG of tests/docs/exceptions.py is for such commands")
    output = (done.stdout + b"\n" + done.stderr).decode(errors="replace")
    return Ran(done.returncode, output)


def wrong(command: Command, ran: Ran) -> str | None:
    """What is wrong with what came of it."""
    if ran.exit_code == command.exit_code:
        return None
    said = f"the page says exit code {command.exit_code}, it was {ran.exit_code}"
    return f"{command.place}: {command.text}\n{said}:\n{ran.output.strip()}"


def unread(command: Command) -> list[str]:
    """What is wrong with a command that is not run: a program that nobody lists, a target that is not there, an unknown option."""
    found = []
    known = command.program in RUN | NOT_RUN.keys() or Path(command.program).name == "tautline"
    if not known:
        found.append(f"{command.place}: `{command.program}` is neither run nor excepted in tests/docs/exceptions.py")
    if command.program == "cargo":
        found += missing_targets(command)
    return found + [f"{command.place}: {one}" for arguments in spoken(command.text) for one in unknown_arguments(arguments)]


def unread_within(page: Page) -> list[str]:
    """What is wrong with the commands that a page names within its lines."""
    named = [one for one in page.spoken if re.match(r"(tautline|cargo) [a-z]", one.target)]
    return [wrong for one in named for wrong in unread(Command(one.target, one.place, page.name, 0))]


def missing_targets(command: Command) -> list[str]:
    found = []
    for option, name in re.findall(r"(--example|--bench|--test) ([\w-]+)", command.text):
        folders = [root / CARGO_TARGETS[option] for root in (ROOT, *(ROOT / "crates").iterdir())]
        if not any((folder / f"{name}.rs").exists() or (folder / name / "main.rs").exists() for folder in folders):
            found.append(f"{command.place}: there is no {CARGO_TARGETS[option]}/{name}.rs, nor {name}/main.rs")
    return found


def spoken(text: str) -> list[list[str]]:
    """The arguments of every call of tautline in some text: a command, or a file that holds commands."""
    if text.startswith("tautline "):
        return [shlex.split(text)[1:]]
    calls = re.findall(r"(?:^|[\s(\"'])(?:/[\w/.-]*/)?tautline((?: +[^\s|;&)\"'<>#`]+)+)", text)
    return [call.split() for call in calls]


def unknown_arguments(arguments: list[str]) -> list[str]:
    """Commands and options that the program's help does not have."""
    words = [word for word in arguments[:2] if re.fullmatch(r"[a-z]+", word)]
    if not words or words[0] not in subcommands(()):
        return [f"tautline has no command `{arguments[0]}`"]
    path = (words[0],)
    if deeper := subcommands(path):
        if len(words) < 2 or words[1] not in deeper:
            return [f"tautline {words[0]} has no command `{' '.join(words[1:])}`"]
        path = (words[0], words[1])
    options = [word.split("=")[0] for word in arguments if re.match(r"--?[a-z]", word)]
    return [f"tautline {' '.join(path)} has no option {one}" for one in options if one not in known_options(path)]


@functools.cache
def help_of(path: tuple[str, ...]) -> str:
    return subprocess.run([TAUTLINE, *path, "--help"], capture_output=True, text=True, check=True).stdout


def subcommands(path: tuple[str, ...]) -> list[str]:
    section = re.search(r"^Commands:\n(.*?)\n\n", help_of(path), re.MULTILINE | re.DOTALL)
    return re.findall(r"^  ([a-z]+) ", section[1], re.MULTILINE) if section else []


def known_options(path: tuple[str, ...]) -> set[str]:
    return set(re.findall(r"^ +(-\w)\b", help_of(path), re.MULTILINE)) | set(re.findall(r"--[a-z][\w-]*", help_of(path)))


def missing_lines(shown: str, printed: str) -> str | None:
    """The first line that a page shows and the command did not print: its lines stand one below the other, but for `...`."""
    have = [line.rstrip() for line in printed.splitlines()]
    position = 0
    for part in re.split(r"^\.\.\.$", shown, flags=re.MULTILINE):
        want = [line.rstrip() for line in part.strip("\n").splitlines()]
        places = (at for at in range(position, len(have) - len(want) + 1) if have[at : at + len(want)] == want)
        at = next(places, None)
        if at is None:
            return next((line for line in want if line not in have), part.strip())
        position = at + len(want)
    return None
