"""Tests of what a release publishes: crates, wheel, archive, notes, licences and versions of dependencies.

Usage: `python -m unittest discover --start-directory tests/ci`. Builds are debug builds in `target`.
"""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import unittest

from test_ci import PROGRAM, ROOT, TARGET, VERSION, run

DENY = ROOT / "target/deny/bin/cargo-deny"
MATURIN = ROOT / "target/python/bin/maturin"
PUBLISHED = {"tautline"} | {f"tautline-{folder.name}" for folder in (ROOT / "crates").iterdir()}
MINUTES = 1800


class Copied(unittest.TestCase):
    """A copy of the tracked files, which a test may change."""

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)
        files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout
        for name in files.decode().split("\0"):
            source = ROOT / name
            if name and source.is_file() and source.suffix not in (".gif", ".png"):
                (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(source, self.folder / name)

    def edit(self, name, before, after):
        text = (self.folder / name).read_text()
        self.assertIn(before, text)
        (self.folder / name).write_text(text.replace(before, after, 1))


class Notes(Copied):
    def notes(self, version):
        return run("sh", self.folder / ".github/notes.sh", version, folder=self.folder)

    def test_notes_are_the_section_of_the_version(self):
        self.edit("CHANGELOG.md", "## Unreleased", f"## {VERSION} (2030-01-01)")
        text = (self.folder / "CHANGELOG.md").read_text()
        (self.folder / "CHANGELOG.md").write_text(text + "\n## 0.0.1\n\n- an older change\n")
        done = self.notes(f"v{VERSION}")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue(done.stdout.startswith("### Added"), done.stdout[:80])
        self.assertNotIn("an older change", done.stdout)
        self.assertEqual(self.notes("0.0.1").returncode, 1, "CITATION.cff has another version")

    def test_a_version_without_a_section_has_no_notes(self):
        done = self.notes("9.9.9")
        self.assertEqual((done.returncode, done.stdout), (1, ""))
        self.assertIn('rename "## Unreleased" to "## 9.9.9"', done.stderr)

    def test_versions_agree(self):
        self.assertIn(f"\nversion: {VERSION}\n", (ROOT / "CITATION.cff").read_text())


class Crates(Copied):
    def crates(self, *words, **environment):
        script = self.folder / ".github/crates.sh"
        return subprocess.run(["sh", script, *words], env=os.environ | environment, capture_output=True, text=True,
                              timeout=MINUTES, check=False)

    def test_packages_contain_all_files_that_they_need(self):
        """Checks the unpacked packages as members of another workspace, without the tree they came from."""
        packed = self.folder / "packed"
        done = self.crates("package", "--offline", "--no-verify", "--allow-dirty", "--target-dir", str(packed))
        self.assertEqual(done.returncode, 0, done.stderr)
        archives = sorted((packed / "package").glob("*.crate"))
        names = {archive.name.removesuffix(f"-{VERSION}.crate") for archive in archives}
        self.assertEqual(names, PUBLISHED)
        unpacked = self.folder / "unpacked"
        for archive in archives:
            self.assertLess(archive.stat().st_size, 10 << 20, "the limit of the registry")
            with tarfile.open(archive) as files:
                files.extractall(unpacked, filter="data")
        whole = (self.folder / "Cargo.toml").read_text()
        profiles = whole[whole.index("[profile.dev]"):]
        patches = "".join(f'{name} = {{ path = "{name}-{VERSION}" }}\n' for name in sorted(PUBLISHED))
        manifest = f'[workspace]\nresolver = "3"\nmembers = ["*"]\n\n[patch.crates-io]\n{patches}\n{profiles}'
        (unpacked / "Cargo.toml").write_text(manifest)
        shutil.copy2(self.folder / "Cargo.lock", unpacked)
        # The folder `target` already holds the dependencies.
        check = ["cargo", "check", "--offline", "--workspace", "--bins", "--lib", "--target-dir", ROOT / "target"]
        done = subprocess.run(check, cwd=unpacked, capture_output=True, text=True, timeout=MINUTES, check=False)
        self.assertEqual(done.returncode, 0, done.stderr[-4000:])

    def test_the_repository_is_written_into_each_published_manifest(self):
        url = "https://example.invalid/owner/tautline"
        done = self.crates("package", "--offline", "--list", REPOSITORY=url)
        self.assertEqual(done.returncode, 0, done.stderr)
        words = ["cargo", "metadata", "--no-deps", "--offline", "--format-version", "1"]
        listed = json.loads(subprocess.run(words, cwd=self.folder, capture_output=True, check=True).stdout)
        having = {package["name"] for package in listed["packages"] if package["repository"] == url}
        self.assertEqual(having, PUBLISHED)

    def test_wrong_arguments_are_named(self):
        done = self.crates("publsh")
        self.assertEqual(done.returncode, 2)
        self.assertIn("must be package or publish", done.stderr)
        done = self.crates("package", REPOSITORY="owner/tautline")
        self.assertEqual(done.returncode, 2)
        self.assertIn("REPOSITORY: must be a URL", done.stderr)

    def test_examples_and_tests_are_not_published(self):
        words = ["cargo", "metadata", "--no-deps", "--offline", "--format-version", "1"]
        listed = json.loads(subprocess.run(words, cwd=ROOT, capture_output=True, check=True).stdout)
        # An empty list of registries forbids publishing.
        self.assertEqual({of["name"] for of in listed["packages"] if of["publish"] != []}, PUBLISHED)


class SupplyChain(unittest.TestCase):
    def check(self, config):
        with tempfile.NamedTemporaryFile("w", suffix=".toml") as file:
            file.write(config)
            file.flush()
            words = [DENY, "--offline", "--config", file.name, "check", "--hide-inclusion-graph"]
            return run(*words, "bans", "licenses", "sources", folder=ROOT)

    def test_licences_versions_and_sources_are_allowed(self):
        done = self.check((ROOT / "deny.toml").read_text())
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_another_licence_or_version_is_found(self):
        config = (ROOT / "deny.toml").read_text()
        for entry, problem in [('    "MIT",\n', "license is not explicitly allowed"), ("syn@2", "2 duplicate entries")]:
            [line] = [line for line in config.splitlines(keepends=True) if entry.strip() in line]
            done = self.check(config.replace(line, ""))
            self.assertNotEqual(done.returncode, 0)
            self.assertIn(problem, done.stdout + done.stderr)


class Installed(unittest.TestCase):
    """What a user installs, in a new folder."""

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)

    def test_an_archive_flies_the_ten_minute_tour(self):
        environment = {"RELEASES": self.folder.as_uri()}
        done = run("sh", ROOT / ".github/package.sh", PROGRAM, TARGET, self.folder, folder=self.folder)
        self.assertEqual(done.returncode, 0, done.stderr)
        done = run("sh", ROOT / ".github/install.sh", VERSION, "bin", folder=self.folder, **environment)
        self.assertEqual(done.returncode, 0, done.stderr)
        tour = [sys.executable, "-m", "unittest", "discover", "--start-directory", ROOT / "tests/docs", "-k",
                "ten_minutes_is_carried_out"]
        done = subprocess.run(tour, cwd=self.folder, env=os.environ | {"TAUTLINE": str(self.folder / "bin/tautline")},
                              capture_output=True, text=True, timeout=MINUTES, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("Ran 1 test", done.stderr)

    def test_an_archive_with_the_viewer_has_another_name(self):
        done = run("sh", ROOT / ".github/package.sh", PROGRAM, TARGET, self.folder, "viewer", folder=self.folder)
        self.assertEqual(pathlib.Path(done.stdout.strip()).name, f"tautline-{VERSION}-{TARGET}-viewer.tar.gz")

    def test_a_wheel_works_in_a_clean_environment(self):
        words = [MATURIN, "build", "--manifest-path", ROOT / "python/Cargo.toml", "--out", "dist"]
        done = subprocess.run(words, cwd=self.folder, capture_output=True, text=True, timeout=MINUTES, check=False)
        self.assertEqual(done.returncode, 0, done.stderr[-4000:])
        [wheel] = (self.folder / "dist").glob("*.whl")
        self.assertRegex(wheel.name, rf"^tautline-{re.escape(VERSION)}-cp310-abi3-")
        subprocess.run([sys.executable, "-m", "venv", self.folder / "venv"], check=True)
        install = [self.folder / "venv/bin/pip", "install", "--quiet", "--disable-pip-version-check", wheel]
        subprocess.run(install, check=True, timeout=MINUTES)
        tautline, python = self.folder / "venv/bin/tautline", self.folder / "venv/bin/python"
        done = run(tautline, "run", "pentagon", "--set", "law.kind=displacement", folder=self.folder)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("CLEAR: never closer than 2.435 m", done.stdout)
        script = "import tautline as tl; a = tl.audit('out/pentagon', delta=2.44); print(a.status, tl.__version__)"
        done = run(python, "-c", script, folder=self.folder)
        self.assertEqual(done.stdout.split(), ["violation", VERSION], done.stderr)


if __name__ == "__main__":
    unittest.main()
