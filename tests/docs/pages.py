"""A page of Markdown as its readers and its tests see it: blocks of code, headings that can be linked to, links."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

FENCE = re.compile(r"^( *)```(\w*) *$")
HEADING = re.compile(r"^#{1,6} +(.*?) *$")
# What stands below the header of a table.
RULE = re.compile(r"\|[-:| ]*-[-:| ]*\|$")
LINK = re.compile(r"\]\(([^()\s]+)\)")
CODE = re.compile(r"(`+)(?:.*?)\1")
NAMED = re.compile(r"^(?:#|//|<!--) (\S+\.\w+)(?: -->)?$")


@dataclass(frozen=True)
class Block:
    """A block of code, and where it begins."""

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
        """The file that its first line says it is."""
        first = self.text.split("\n", 1)[0]
        found = NAMED.match(first)
        return found[1] if found else None


@dataclass(frozen=True)
class Said:
    """Where a link leads, as it is written, or a word of code within a line."""

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
        """Code within a line, and where."""
        self.headings: list[str] = []
        self.headless: list[str] = []
        """Where a row of a table stands that has no header above it, and so is shown as text."""
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
                if line.startswith("|") and not above.startswith("|") and not RULE.match("".join(lines[number : number + 1])):
                    self.headless.append(f"{self.name}:{number}")
                self.spoken += [Said(found[0].strip("`"), f"{self.name}:{number}") for found in CODE.finditer(line)]
                bare = CODE.sub("", re.sub(r"\[`[^`]*`\]", "[code]", line))
                self.links += [Said(target, f"{self.name}:{number}") for target in LINK.findall(bare)]
            above = line
        if fence:
            raise ValueError(f"{self.name}:{begin}: this block of code has no end")

    @property
    def anchors(self) -> set[str]:
        """What may stand behind a # in a link to this page, as Git hosts and mdBook make it of headings."""
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
    """Every page that is tested, in the order of the book."""
    docs = sorted((ROOT / "docs").glob("*.md"))
    return [Page(path) for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "ARCHITECTURE.md", *docs)]


def dead_links(page: Page, root: Path = ROOT) -> list[str]:
    """What is wrong with each link of a page that does not lead to a file, or a heading, that is there."""
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
