"""A page of Markdown: blocks of code, headings, links."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

FENCE = re.compile(r"^( *)```(\w*) *$")
HEADING = re.compile(r"^#{1,6} +(.*?) *$")
# Line below the header of a table.
RULE = re.compile(r"\|[-:| ]*-[-:| ]*\|$")
LINK = re.compile(r"\]\(([^()\s]+)\)")
CODE = re.compile(r"(`+)(?:.*?)\1")
NAMED = re.compile(r"^(?:#|//|<!--) (\S+\.\w+)(?: -->)?$")


@dataclass(frozen=True)
class Block:
    """A block of code and its place."""

    language: str
    text: str
    page: str
    line: int
    section: str
    """Heading above it."""

    @property
    def place(self) -> str:
        return f"{self.page}:{self.line}"

    @property
    def name(self) -> str | None:
        """Name of the file in the first line."""
        first = self.text.split("\n", 1)[0]
        found = NAMED.match(first)
        return found[1] if found else None


@dataclass(frozen=True)
class Said:
    """Target of a link, or code within a line, with its place."""

    target: str
    place: str


class Page:
    """A page, read once."""

    def __init__(self, path: Path, root: Path = ROOT) -> None:
        self.path = path
        self.name = path.relative_to(root).as_posix()
        self.blocks: list[Block] = []
        self.links: list[Said] = []
        self.spoken: list[Said] = []
        """Code within lines."""
        self.headings: list[str] = []
        self.headless: list[str] = []
        """Places of rows of tables without a header, which Markdown shows as text."""
        self._read(path.read_text(encoding="utf-8").splitlines())

    def _read(self, lines: list[str]) -> None:
        fence: re.Match[str] | None = None
        begin, code, section = 0, [], ""
        above = ""
        for number, line in enumerate(lines, 1):
            found = FENCE.match(line)
            if fence:
                if found and not found[2]:
                    self.blocks.append(Block(fence[2], "\n".join(code), self.name, begin, section))
                    fence = None
                else:
                    code.append(line.removeprefix(fence[1]))
            elif found:
                fence, begin, code = found, number, []
            else:
                if heading := HEADING.match(line):
                    section = heading[1]
                    self.headings.append(section)
                below = "".join(lines[number : number + 1])
                if line.startswith("|") and not above.startswith("|") and not RULE.match(below):
                    self.headless.append(f"{self.name}:{number}")
                self.spoken += [Said(found[0].strip("`"), f"{self.name}:{number}") for found in CODE.finditer(line)]
                bare = CODE.sub("", re.sub(r"\[`[^`]*`\]", "[code]", line))
                self.links += [Said(target, f"{self.name}:{number}") for target in LINK.findall(bare)]
            above = line
        if fence:
            raise ValueError(f"{self.name}:{begin}: this block of code has no end")

    @property
    def anchors(self) -> set[str]:
        """Anchors of the headings, as Git hosts and mdBook generate them."""
        made: list[str] = []
        for heading in self.headings:
            words = re.sub(r"\]\([^)]*\)", "", heading).lower()
            anchor = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
            again = made.count(anchor)
            made.append(anchor)
            if again:
                made.append(f"{anchor}-{again}")
        return set(made)


def pages() -> list[Page]:
    """Returns all pages that are tested."""
    docs = sorted((ROOT / "docs").glob("*.md"))
    return [Page(path) for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "ARCHITECTURE.md", *docs)]


def dead_links(page: Page, root: Path = ROOT) -> list[str]:
    """Returns an error for each link to a missing file or heading."""
    wrong = []
    for link in page.links:
        if re.match(r"[a-z]+:", link.target):
            continue
        file, _, anchor = link.target.partition("#")
        target = (page.path.parent / file).resolve() if file else page.path.resolve()
        if not target.exists():
            wrong.append(f"{link.place}: {link.target} leads to no file")
        elif anchor and (target.suffix != ".md" or anchor not in Page(target, root.resolve()).anchors):
            wrong.append(f"{link.place}: {link.target} leads to no heading of {file or page.name}")
    return wrong
