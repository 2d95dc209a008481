"""The book: its contents name every page once, its index says what each answers, and scenario.md is what the schema says."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
import unittest
from pathlib import Path

from commands import TAUTLINE
from pages import ROOT, Page

DOCS = ROOT / "docs"
# Keys whose description speaks of another number's unit.
OF_ANOTHER = ("thrust_n_per_rpm2",)

ITEM = re.compile(r"^- \[([^\]]+)\]\(([\w-]+\.md)\)(: .+)?$", re.MULTILINE)

sys.path.insert(0, str(DOCS))
import scenario_reference  # noqa: E402


def items(page: str) -> list[tuple[str, ...]]:
    return ITEM.findall((DOCS / page).read_text(encoding="utf-8"))


class Book(unittest.TestCase):
    """The order of the pages."""

    def test_the_contents_name_every_page_once(self) -> None:
        named = ["README.md", *(file for _, file, _ in items("SUMMARY.md"))]
        self.assertEqual(sorted(named), sorted(path.name for path in DOCS.glob("*.md") if path.name != "SUMMARY.md"))

    def test_the_index_says_of_every_page_what_it_answers(self) -> None:
        index, contents = items("README.md"), items("SUMMARY.md")
        self.assertEqual([(title, file) for title, file, _ in index], [(title, file) for title, file, _ in contents])
        for title, _, answer in index:
            self.assertGreater(len(answer), 10, f"{title}: what does it answer?")

    def test_links_of_the_book_stay_in_the_book(self) -> None:
        """A link out of docs/ is dead where the book is read."""
        for path in DOCS.glob("*.md"):
            for link in Page(path).links:
                self.assertNotRegex(link.target, r"^(\.\.|/)", link.place)

    def test_mdbook_finds_the_pages(self) -> None:
        book = tomllib.loads((DOCS / "book.toml").read_text(encoding="utf-8"))
        self.assertEqual(book["book"]["src"], ".")


class ScenarioReference(unittest.TestCase):
    """docs/scenario.md"""

    schema: dict

    @classmethod
    def setUpClass(cls) -> None:
        printed = subprocess.run([TAUTLINE, "schema"], capture_output=True, check=True).stdout
        cls.schema = scenario_reference.json.loads(printed)
        cls.made = scenario_reference.Reference(cls.schema).page()

    def test_the_page_is_what_the_schema_says(self) -> None:
        page = (DOCS / "scenario.md").read_text(encoding="utf-8")
        self.assertEqual(page, self.made, "make it anew: tautline schema | python3 docs/scenario_reference.py > docs/scenario.md")

    def test_every_key_of_the_schema_is_on_the_page(self) -> None:
        for key in sorted(keys_of(self.schema)):
            self.assertTrue(f"`{key}`" in self.made or f"[{key}" in self.made, key)

    def test_a_unit_is_the_one_that_the_description_says(self) -> None:
        """What a description says of its unit, "... in m/s", ends the name of the key too."""
        units = sorted({*scenario_reference.UNITS.values(), *scenario_reference.UNNAMED.values()}, key=len, reverse=True)
        said = re.compile(rf" in ({'|'.join(map(re.escape, units))})(?= |[,.:;]|$)")
        checked = 0
        for line in self.made.splitlines():
            if not line.startswith("| `") or line.startswith(tuple(f"| `{key}`" for key in OF_ANOTHER)):
                continue
            cells = [cell.strip() for cell in line.split(" | ")]
            if cells[1] != "text" and (found := said.search(cells[-1])):
                self.assertEqual(cells[2], found[1], line)
                checked += 1
        self.assertGreater(checked, 80)

    def test_a_key_that_is_changed_changes_the_page(self) -> None:
        other = scenario_reference.json.loads(scenario_reference.json.dumps(self.schema))
        other["$defs"]["TimeTable"]["properties"]["duration_s"]["exclusiveMinimum"] = 7
        self.assertNotEqual(scenario_reference.Reference(other).page(), self.made)


def keys_of(schema: object) -> set[str]:
    if isinstance(schema, list):
        return set().union(*map(keys_of, schema))
    if not isinstance(schema, dict):
        return set()
    own = set(schema["properties"]) if isinstance(schema.get("properties"), dict) else set()
    return own.union(*map(keys_of, schema.values()))


if __name__ == "__main__":
    unittest.main()
