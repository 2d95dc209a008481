"""Tests of the tests of pages: a page with a fault has an error."""

from __future__ import annotations

import tempfile
import unittest
from pathlib import Path

from fixtures import Fixtures
from pages import Page, dead_links
from test_pages import Walk

RIGHT = """\
# A page

```sh
tautline check pentagon --set law.alpha=2
tautline check pentagon-collinear          # exit code 1: a straight line is never left
```

[another heading](#a-page), [a file](README.md), `tautline audit --delta 1`

```toml
# spec.toml
scenario = "pentagon"
runs = 3
seed = 1

[vary]
"start.jitter_m" = { uniform = [0.0, 0.1] }
```

```sh
tautline campaign plan spec.toml --out camp
tautline list
```

```text
scenario             vehicles  time   steps  content
...
thousand             1000      40 s   4000   a thousand vehicles gather in space: clear and reached
```

```sh
cargo test --test docs_of_tautline
```
"""

# Fault: text of the page above, its replacement, and a part of the error.
FAULTS = {
    "an unknown option": ("--set law.alpha=2", "--sett law.alpha=2", "unexpected argument"),
    "an unknown command": ("tautline list", "tautline lists", "unrecognized subcommand"),
    "an unknown key": ("law.alpha=2", "law.alhpa=2", "unknown"),
    "an unknown option within a line": ("audit --delta", "audit --dleta", "has no option --dleta"),
    "a missing exit code": ("# exit code 1: a", "# a", "the page says exit code 0, it was 1"),
    "a wrong exit code": ("tautline list\n", "tautline list  # exit code 1\n", "the page says exit code 1, it was 0"),
    "old output": ("a thousand vehicles", "a million vehicles", "a million vehicles"),
    "lines in the wrong order": ("scenario  ", "thousand  ", "thousand  "),
    "omitted lines without `...`": ("...\n", "", "does not print"),
    "a file with a wrong key": ("runs = 3", "rums = 3", "rums"),
    "a malformed file": ("runs = 3", "runs 3", "runs"),
    "an unlisted program": ("tautline list", "tautlime list", "`tautlime` is neither run nor excepted"),
    "an unknown test": (
        "cargo test --test docs_of_tautline",
        "cargo test -p tautline-laws --lib no_such_test",
        "no test of crates/laws is called no_such_test",
    ),
    "an unknown option of a command that is not run": (
        "cargo test --test docs_of_tautline",
        "ssh node7 /shared/tautline campaign shard camp --shards 1",
        "has no option --shards",
    ),
}


class Twins(unittest.TestCase):
    """Tests of pages with a fault."""

    fixtures: Fixtures

    @classmethod
    def setUpClass(cls) -> None:
        place = tempfile.TemporaryDirectory(prefix="tautline-docs-twins-")
        cls.addClassCleanup(place.cleanup)
        cls.root = Path(place.name)
        (cls.root / "README.md").write_text("# Read me\n", encoding="utf-8")
        cls.fixtures = Fixtures()

    def page(self, text: str) -> Page:
        path = self.root / "page.md"
        path.write_text(text, encoding="utf-8")
        return Page(path, self.root)

    def faults_of(self, text: str) -> list[str]:
        page = self.page(text)
        return Walk(page, self.fixtures.folder(page.name), self.fixtures.programs).walk()

    def test_the_missing_target_is_the_only_error_of_the_page(self) -> None:
        found = self.faults_of(RIGHT)
        self.assertEqual(len(found), 1, found)
        self.assertIn("there is no tests/docs_of_tautline.rs", found[0])

    def test_each_fault_is_found(self) -> None:
        for what, (right, wrong, said) in FAULTS.items():
            with self.subTest(what):
                self.assertIn(right, RIGHT)
                found = self.faults_of(RIGHT.replace(right, wrong, 1))
                self.assertTrue(any(said in one for one in found), found)

    def test_an_excerpt_that_its_file_does_not_have_is_found(self) -> None:
        code = "// examples/own_law.rs\nimpl Law for SpringsAndRepulsion {\n// ...\nfn main() {}\n"
        found = self.faults_of(f"# A page\n\n```rust\n{code}```\n")
        self.assertEqual(len(found), 1, found)
        self.assertIn("fn main() {}", found[0])

    def test_json_and_yaml_that_do_not_parse_are_found(self) -> None:
        for language, text in {"json": '{"a": }', "yaml": "a: [1", "python": "def f(:"}.items():
            with self.subTest(language):
                self.assertTrue(self.faults_of(f"# A page\n\n```{language}\n{text}\n```\n"))

    def test_dead_links_are_found(self) -> None:
        dead = "[a](nowhere.md) [b](#no-heading) [c](README.md#no-heading)"
        page = self.page(f"# A page\n\n{dead} [d](README.md#read-me) `[e](no.md)`\n")
        self.assertEqual(len(dead_links(page, self.root)), 3)

    def test_a_block_without_an_end_is_found(self) -> None:
        with self.assertRaisesRegex(ValueError, "has no end"):
            self.page("# A page\n\n```sh\ntautline list\n")


if __name__ == "__main__":
    unittest.main()
