"""Tests of every page of the docs: commands run and print the shown output, files are valid, links have targets."""

from __future__ import annotations

import unittest
from pathlib import Path

import exceptions
from commands import Command, Ran, as_run, commands, missing_lines, run, unread, unread_within, wrong
from data import wrong_data
from fixtures import Fixtures
from pages import Block, Page, dead_links, pages


class Walk:
    """A run of a page from top to bottom."""

    def __init__(self, page: Page, folder: Path, programs: Path) -> None:
        self.page, self.folder, self.programs = page, folder, programs
        self.wrong: list[str] = []

    def walk(self) -> list[str]:
        """Returns all errors of the page, in its order."""
        last: tuple[str, Ran | None] = "", None
        for block in self.page.blocks:
            if block.name and block.language != "rust":
                (self.folder / Path(block.name).name).write_text(block.text + "\n", encoding="utf-8")
            if block.language == "sh":
                last = block.section, self.carry_out(block)
            elif block.language == "text":
                shown_below = last[0] == block.section and last[1]
                if shown_below:
                    self.compare(block, shown_below)
                last = "", None
            else:
                self.wrong += wrong_data(block, self.folder, self.programs)
        return self.wrong + unread_within(self.page)

    def carry_out(self, block: Block) -> Ran | None:
        """Runs the commands of a block. Returns the result of the last one, if it was run."""
        ran: Ran | None = None
        for command in commands(block):
            self.wrong += unread(command)
            text = as_run(command)
            ran = self.run(command, text) if text else None
        return ran

    def run(self, command: Command, text: str) -> Ran:
        ran = run(text, self.folder, self.programs)
        if failed := wrong(command, ran):
            self.wrong.append(failed)
        return ran

    def compare(self, block: Block, ran: Ran) -> None:
        if (line := missing_lines(block.text, ran.output)) is not None:
            self.wrong.append(f"{block.place}: the command above does not print\n{line}\nbut\n{ran.output.strip()}")


fixtures: Fixtures


def setUpModule() -> None:
    global fixtures
    fixtures = Fixtures()


class Pages(unittest.TestCase):
    """Tests of each page, which are added below."""

    def carried_out(self, page: Page) -> None:
        folder = fixtures.folder(page.name)
        found = Walk(page, folder, fixtures.programs).walk()
        self.assertFalse(found, "\n\n".join(["", *found]))

    def links_lead_somewhere(self, page: Page) -> None:
        found = dead_links(page)
        self.assertFalse(found, "\n".join(["", *found]))


class Exceptions(unittest.TestCase):
    """Tests that every exception is in use."""

    def test_each_is_of_a_page_as_it_is(self) -> None:
        blocks = [block for page in pages() for block in page.blocks]
        called = [command for block in blocks if block.language == "sh" for command in commands(block)]
        for page, begin in [*exceptions.NOT_RUN_HERE, *exceptions.LONG]:
            self.assertTrue(any(one.page == page and one.text.startswith(begin) for one in called), (page, begin))
        for begin in exceptions.RUN_ALSO:
            self.assertTrue(any(one.text.startswith(begin) for one in called), begin)
        for command in exceptions.INSTEAD:
            self.assertTrue(any(one.text == command for one in called), command)
        for program in [*exceptions.NOT_RUN, *exceptions.RUN]:
            self.assertTrue(any(one.program == program for one in called), program)


def test_of(page: Page, what: str):
    def test(self: Pages) -> None:
        getattr(self, what)(page)

    test.__doc__ = f"{page.name}: {what.replace('_', ' ')}"
    return test


for one in pages():
    called = one.name.replace("/", "_").replace(".md", "").replace("-", "_").lower()
    setattr(Pages, f"test_{called}_is_carried_out", test_of(one, "carried_out"))
    setattr(Pages, f"test_{called}_links", test_of(one, "links_lead_somewhere"))


if __name__ == "__main__":
    unittest.main()
