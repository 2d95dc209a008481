"""Tests of the book: its contents and index list every page, and scenario.md follows from the schema."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from typing import Iterator

from commands import TAUTLINE
from pages import ROOT, Page

DOCS = ROOT / "docs"
MDBOOK = ROOT / "target/mdbook/bin/mdbook"
# Keys whose description names the unit of another number.
OF_ANOTHER = ("thrust_n_per_rpm2",)

ITEM = re.compile(r"^- \[([^\]]+)\]\(([\w-]+\.md)\)(: .+)?$", re.MULTILINE)

AREAS = """scenario recording audit export request compare margin sweep attack campaign render pictures files usage
machine law simulation watch"""
CODE = re.compile(rf'"((?:{"|".join(AREAS.split())})/[a-z0-9-]+)"')

sys.path.insert(0, str(DOCS))
import scenario_reference  # noqa: E402


def items(docs: Path, page: str) -> list[tuple[str, ...]]:
    """Returns title, file and description of each page in a list of pages."""
    return ITEM.findall((docs / page).read_text(encoding="utf-8"))


def faults(docs: Path) -> list[str]:
    """Returns the errors in the order of the pages, in their tables and in their links."""
    contents, index = items(docs, "SUMMARY.md"), items(docs, "README.md")
    there = {path.name for path in docs.glob("*.md")} - {"SUMMARY.md", "README.md"}
    named = [file for _, file, _ in contents]
    wrong = [f"SUMMARY.md does not name {file}" for file in sorted(there - set(named))]
    wrong += [f"{file} of SUMMARY.md is not there" for file in sorted(set(named) - there)]
    wrong += [f"SUMMARY.md names {file} twice" for file in sorted(set(named)) if named.count(file) > 1]
    if [one[:2] for one in contents] != [one[:2] for one in index]:
        wrong.append("SUMMARY.md and README.md name other pages, or in another order")
    wrong += [f"README.md does not say what {file} answers" for _, file, answer in index if len(answer) < 10]
    pages = [Page(path, docs) for path in sorted(docs.glob("*.md"))]
    wrong += [f"{place}: this row of a table has no header above it" for page in pages for place in page.headless]
    outside = [link for page in pages for link in page.links if re.match(r"\.\.|/", link.target)]
    return wrong + [f"{link.place}: {link.target} is dead where the book is read" for link in outside]


def build(docs: Path, out: Path) -> str:
    """Builds the book into `out`; returns warnings and errors of mdBook."""
    run = subprocess.run([MDBOOK, "build", docs, "--dest-dir", out], capture_output=True, text=True, check=False)
    lines = (run.stdout + run.stderr).splitlines()
    return "\n".join(line for line in lines if not line.startswith(" INFO")) or ("ERROR" if run.returncode else "")


class Book(unittest.TestCase):
    """Tests of the order of the pages and of the codes of errors."""

    def test_contents_and_index_name_every_page_and_links_stay_in_the_book(self) -> None:
        self.assertEqual(faults(DOCS), [])

    def test_every_code_of_an_error_is_explained_and_no_other(self) -> None:
        sources = [path for folder in ("src", "crates", "python/src") for path in (ROOT / folder).rglob("*.rs")]
        texts = [path.read_text(encoding="utf-8") for path in sources if "tests" not in path.parts]
        written = {code for text in texts for code in CODE.findall(text)}
        explained = set(re.findall(r"`([a-z]+/[a-z0-9-]+)`", (DOCS / "errors.md").read_text(encoding="utf-8")))
        self.assertGreater(len(written), 50)
        self.assertEqual(written, explained)

    def test_errors_of_a_book_are_found(self) -> None:
        right = {
            "SUMMARY.md": "- [A](a.md)\n- [B](b.md)\n",
            "README.md": "- [A](a.md): what is that?\n- [B](b.md): and what is this?\n",
            "a.md": "# A\n\n[b](b.md)\n",
            "b.md": "# B\n",
        }
        changes = {
            "": ("SUMMARY.md", right["SUMMARY.md"]),
            "does not name c.md": ("c.md", "# C\n"),
            "c.md of SUMMARY.md is not there": ("SUMMARY.md", "- [A](a.md)\n- [B](b.md)\n- [C](c.md)\n"),
            "names a.md twice": ("SUMMARY.md", "- [A](a.md)\n- [B](b.md)\n- [A](a.md)\n"),
            "in another order": ("SUMMARY.md", "- [B](b.md)\n- [A](a.md)\n"),
            "does not say what b.md answers": ("README.md", "- [A](a.md): what is that?\n- [B](b.md)\n"),
            "a.md:3: ../x.md is dead": ("a.md", "# A\n\n[x](../x.md)\n"),
            "b.md:5: this row of a table has no header": ("b.md", "| a |\n| --- |\n| 1 |\n\n| 2 |\n"),
        }
        for said, (file, text) in changes.items():
            with self.subTest(said), tempfile.TemporaryDirectory() as place:
                for name, words in (right | {file: text}).items():
                    (Path(place) / name).write_text(words, encoding="utf-8")
                found = faults(Path(place))
                self.assertTrue(any(said in one for one in found) if said else not found, found)

    def test_mdbook_builds_every_page_and_a_search_index(self) -> None:
        with tempfile.TemporaryDirectory() as place:
            self.assertEqual(build(DOCS, Path(place)), "")
            pages = [file.removesuffix(".md") + ".html" for _, file, _ in items(DOCS, "SUMMARY.md")]
            self.assertEqual([page for page in pages if not (Path(place) / page).is_file()], [])
            [index] = Path(place).glob("searchindex*.js")
            for word in ("certificate", "delta_m", "crazyflies"):
                self.assertIn(word, index.read_text(encoding="utf-8"))

    def test_a_book_with_a_broken_summary_is_not_built(self) -> None:
        with tempfile.TemporaryDirectory() as place:
            (Path(place) / "SUMMARY.md").write_text("- [A](a.md\n", encoding="utf-8")
            (Path(place) / "book.toml").write_text('[book]\ntitle = "x"\nsrc = "."\n', encoding="utf-8")
            self.assertIn("ERROR", build(Path(place), Path(place) / "out"))


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
        remedy = "run tautline schema | python3 docs/scenario_reference.py > docs/scenario.md"
        self.assertEqual(page, self.made, remedy)

    def test_every_key_of_the_schema_is_on_the_page(self) -> None:
        for key in sorted(keys_of(self.schema)):
            self.assertTrue(any(said in self.made for said in (f"`{key}`", f"[{key}", f".{key}]")), key)

    def test_keys_and_descriptions_have_the_same_unit(self) -> None:
        """The unit of a description, "... in m/s", is the unit of the key. The page has it once."""
        units = {*scenario_reference.UNITS.values(), *scenario_reference.UNNAMED.values()}
        units = sorted(units, key=len, reverse=True)
        said = re.compile(rf" in ({'|'.join(map(re.escape, units))})(?= |[,.:;]|$)")
        checked = 0
        for name, key in described(self.schema):
            found = said.search(" ".join(key["description"].split()))
            if found and key.get("type") != "string" and name not in OF_ANOTHER:
                self.assertEqual(scenario_reference.unit(name), found[1], name)
                checked += 1
        self.assertGreater(checked, 80)

    def test_a_key_that_is_changed_changes_the_page(self) -> None:
        other = scenario_reference.json.loads(scenario_reference.json.dumps(self.schema))
        other["$defs"]["TimeSpec"]["properties"]["duration_s"]["exclusiveMinimum"] = 7
        self.assertNotEqual(scenario_reference.Reference(other).page(), self.made)


def described(schema: object) -> Iterator[tuple[str, dict]]:
    """Yields each key with a description, at any depth."""
    if isinstance(schema, list):
        for one in schema:
            yield from described(one)
    elif isinstance(schema, dict):
        for name, key in schema.get("properties", {}).items():
            if isinstance(key, dict) and "description" in key:
                yield name, key
        for one in schema.values():
            yield from described(one)


def keys_of(schema: object) -> set[str]:
    if isinstance(schema, list):
        return set().union(*map(keys_of, schema))
    if not isinstance(schema, dict):
        return set()
    own = set(schema["properties"]) if isinstance(schema.get("properties"), dict) else set()
    return own.union(*map(keys_of, schema.values()))


if __name__ == "__main__":
    unittest.main()
