"""The tests of pages notice what is wrong: each page here has one fault, and is refused for it."""

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
circle              six vehicles from a line to a circle under the edge-tension law: clear and reached
...
swap                twelve vehicles change places across a circle under the displacement law: clear and reached
```

```sh
cargo test --test docs_of_tautline
```
"""

# What is changed in the page above, and a word of what is said of it.
FAULTS = {
    "an option that is not there": ("--set law.alpha=2", "--sett law.alpha=2", "unexpected argument"),
    "a command that is not there": ("tautline list", "tautline lists", "unrecognized subcommand"),
    "a key that is not there": ("law.alpha=2", "law.alhpa=2", "unknown"),
    "an option that is not there, within a line": ("audit --delta", "audit --dleta", "has no option --dleta"),
    "an exit code that is not said": ("# exit code 1: a", "# a", "the page says exit code 0, it was 1"),
    "an exit code that is not so": ("tautline list\n", "tautline list  # exit code 1\n", "the page says exit code 1, it was 0"),
    "output of other days": ("six vehicles from a line", "seven vehicles from a line", "seven vehicles from a line"),
    "lines in the wrong order": ("circle  ", "thousand  ", "thousand  "),
    "a gap that is not shown": ("...\n", "", "does not print"),
    "a file with a wrong key": ("runs = 3", "rums = 3", "rums"),
    "a file that cannot be read": ("runs = 3", "runs 3", "runs"),
    "a program that nobody lists": ("tautline list", "tautlime list", "`tautlime` is neither run nor excepted"),
    "a wrong option of what is not run": (
        "cargo test --test docs_of_tautline", "ssh node7 /shared/tautline campaign shard camp --shards 1", "has no option --shards"
    ),  # fmt: skip
}


class Twins(unittest.TestCase):
    """Pages with a fault."""

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

    def test_only_the_target_that_is_not_there_is_wrong_with_the_page(self) -> None:
        found = self.faults_of(RIGHT)
        self.assertEqual(len(found), 1, found)
        self.assertIn("there is no tests/docs_of_tautline.rs", found[0])

    def test_each_fault_is_found(self) -> None:
        for what, (right, wrong, said) in FAULTS.items():
            with self.subTest(what):
                self.assertIn(right, RIGHT)
                found = self.faults_of(RIGHT.replace(right, wrong, 1))
                self.assertTrue(any(said in one for one in found), found)

    def test_an_excerpt_that_is_not_in_its_file_is_found(self) -> None:
        text = "# A page\n\n```rust\n// examples/own_law.rs\nimpl Law for SpringsAndRepulsion {\n// ...\nfn main() {}\n```\n"
        found = self.faults_of(text)
        self.assertEqual(len(found), 1, found)
        self.assertIn("fn main() {}", found[0])

    def test_json_and_yaml_that_do_not_parse_are_found(self) -> None:
        for language, text in {"json": '{"a": }', "yaml": "a: [1", "python": "def f(:"}.items():
            with self.subTest(language):
                self.assertTrue(self.faults_of(f"# A page\n\n```{language}\n{text}\n```\n"))

    def test_dead_links_are_found(self) -> None:
        page = self.page("# A page\n\n[a](nowhere.md) [b](#no-heading) [c](README.md#no-heading) [d](README.md#read-me) `[e](no.md)`\n")
        self.assertEqual(len(dead_links(page, self.root)), 3)

    def test_a_block_without_an_end_is_found(self) -> None:
        with self.assertRaisesRegex(ValueError, "has no end"):
            self.page("# A page\n\n```sh\ntautline list\n")


if __name__ == "__main__":
    unittest.main()
