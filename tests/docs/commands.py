"""Runs the commands of a page, and checks the arguments of those that it does not run."""

from __future__ import annotations

import functools
import os
import re
import shlex
import subprocess
from dataclasses import dataclass
from pathlib import Path

from exceptions import INSTEAD, LONG, NOT_RUN, NOT_RUN_HERE, RUN, RUN_ALSO
from pages import ROOT, Block, Page

TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
TAUTLINE = Path(os.environ.get("TAUTLINE", TARGET / "debug" / "tautline")).resolve()

# Options of cargo for programs by name, and the folders of these programs.
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
    """Result of a command."""

    exit_code: int
    output: str
    """Standard output followed by standard error."""


def commands(block: Block) -> list[Command]:
    """Returns the commands of a block, with the exit code in a comment on their line, or 0."""
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
    """Returns the command that the tests run, or `None` for a command that they do not run."""
    text = command.text
    if listed(NOT_RUN_HERE, command) or (listed(LONG, command) and not os.environ.get("TAUTLINE_LONG")):
        return None
    if text in INSTEAD:
        return shlex.quote(str(TARGET / INSTEAD[text]))
    if found := re.fullmatch(r"cargo run --release(?: -- (.*))?", text):
        return f"tautline {found[1] or ''}".strip()
    return text if command.program in RUN | {"tautline"} or text.startswith(RUN_ALSO) else None


def listed(table: dict[tuple[str, str], str], command: Command) -> bool:
    return any(page == command.page and command.text.startswith(begin) for page, begin in table)


def run(text: str, folder: Path, programs: Path) -> Ran:
    """Runs a command in a folder, with `tautline` found in `programs`."""
    path = os.pathsep.join([str(programs), "/usr/local/bin", "/usr/bin", "/bin"])
    environment = {"PATH": path, "HOME": str(folder), "NO_COLOR": "1", "COLUMNS": "200"}
    try:
        done = subprocess.run(
            ["sh", "-c", text],
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=MOST_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Ran(-1, f"not done after {MOST_S} s: the table LONG of tests/docs/exceptions.py is for such commands")
    output = (done.stdout + b"\n" + done.stderr).decode(errors="replace")
    return Ran(done.returncode, output)


def wrong(command: Command, ran: Ran) -> str | None:
    """Returns an error unless the exit code is that of the page."""
    if ran.exit_code == command.exit_code:
        return None
    problem = f"the page says exit code {command.exit_code}, it was {ran.exit_code}"
    return f"{command.place}: {command.text}\n{problem}:\n{ran.output.strip()}"


def unread(command: Command) -> list[str]:
    """Returns the errors of a command that is not run: an unlisted program, a missing target, an unknown option."""
    found = []
    known = command.program in RUN | NOT_RUN.keys() or Path(command.program).name == "tautline"
    if not known:
        found.append(f"{command.place}: `{command.program}` is neither run nor excepted in tests/docs/exceptions.py")
    if command.program == "cargo":
        found += missing_targets(command)
    unknown = [error for arguments in spoken(command.text) for error in unknown_arguments(arguments)]
    return found + [f"{command.place}: {error}" for error in unknown]


def unread_within(page: Page) -> list[str]:
    """Returns the errors of commands within the lines of a page."""
    named = [one for one in page.spoken if re.match(r"(tautline|cargo) [a-z]", one.target)]
    return [wrong for one in named for wrong in unread(Command(one.target, one.place, page.name, 0))]


def missing_targets(command: Command) -> list[str]:
    """Returns the targets of cargo and the names of tests that the package of a command does not have."""
    found = []
    package = re.search(r"(?:-p|--package) tautline-([\w-]+)", command.text)
    root = ROOT / "crates" / package[1] if package else ROOT
    for option, name in re.findall(r"(--example|--bench|--test) ([\w-]+)", command.text):
        folder = root / CARGO_TARGETS[option]
        if not ((folder / f"{name}.rs").exists() or (folder / name / "main.rs").exists()):
            found.append(f"{command.place}: there is no {folder.relative_to(ROOT)}/{name}.rs, nor {name}/main.rs")
    if test := re.search(r"cargo test .*(?:--lib|--test \w+) ([\w:]+)", command.text):
        last = test[1].rstrip(":").split("::")[-1]
        sources = (file for folder in ("src", "tests") for file in (root / folder).rglob("*.rs"))
        if not any(re.search(rf"(fn|mod) \w*{last}", file.read_text()) for file in sources):
            found.append(f"{command.place}: no test of {root.relative_to(ROOT)} is called {test[1]}")
    return found


def spoken(text: str) -> list[list[str]]:
    """Returns the arguments of every call of tautline in a text."""
    if text.startswith("tautline "):
        return [shlex.split(text)[1:]]
    calls = re.findall(r"(?:^|[\s(\"'])(?:/[\w/.-]*/)?tautline((?: +[^\s|;&)\"'<>#`]+)+)", text)
    return [call.split() for call in calls]


def unknown_arguments(arguments: list[str]) -> list[str]:
    """Returns errors for commands and options that the help of the program does not have."""
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
    text = help_of(path)
    return set(re.findall(r"^ +(-\w)\b", text, re.MULTILINE)) | set(re.findall(r"--[a-z][\w-]*", text))


def missing_lines(shown: str, printed: str) -> str | None:
    """Returns the first line of a page that the output does not have. `...` stands for omitted lines."""
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
