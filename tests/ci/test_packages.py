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
import zipfile

import yaml

from test_ci import PROGRAM, ROOT, TARGET, VERSION, run

DENY = ROOT / "target/deny/bin/cargo-deny"
MATURIN = ROOT / "target/python/bin/maturin"
PUBLISHED = {"tautline"} | {f"tautline-{folder.name}" for folder in (ROOT / "crates").iterdir()}
MINUTES = 1800


def new_folder(test):
    folder = pathlib.Path(tempfile.mkdtemp())
    test.addCleanup(shutil.rmtree, folder)
    return folder


class Copied(unittest.TestCase):
    """A copy of the tracked files, which a test may change."""

    def setUp(self):
        self.folder = new_folder(self)
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

    def test_addresses_of_the_repository_agree(self):
        [url] = re.findall(r'^repository = "(.*)"$', (ROOT / "Cargo.toml").read_text(), re.MULTILINE)
        owner = url.removeprefix("https://github.com/").removesuffix("/tautline")
        self.assertIn(f'repository-code: "{url}"', (ROOT / "CITATION.cff").read_text())
        pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CITATION.cff", ROOT / "python/pyproject.toml",
                 *(ROOT / "docs").glob("*.md")]
        # The addresses of clones and images, and the names of the action.
        named = {found for page in pages for found in re.findall(r"[\w.-]+/tautline(?=[@:])|https://\S+/tautline\b",
                                                                 page.read_text())}
        self.assertEqual(named, {url, f"{owner}/tautline"})


class Crates(Copied):
    def crates(self, *words, **environment):
        script = self.folder / ".github/crates.sh"
        return subprocess.run(["sh", script, *words], env=os.environ | environment, capture_output=True, text=True,
                              timeout=MINUTES, check=False)

    def test_packages_and_examples_build_without_the_tree(self):
        """Checks the unpacked packages, and the examples against them, in a folder that holds nothing else."""
        packed = self.folder / "packed"
        done = self.crates("package", "--offline", "--no-verify", "--target-dir", str(packed))
        self.assertEqual(done.returncode, 0, done.stderr)
        archives = sorted((packed / "package").glob("*.crate"))
        names = {archive.name.removesuffix(f"-{VERSION}.crate") for archive in archives}
        self.assertEqual(names, PUBLISHED)
        alone = new_folder(self)
        for archive in archives:
            self.assertLess(archive.stat().st_size, 10 << 20, "the limit of the registry")
            with tarfile.open(archive) as files:
                files.extractall(alone, filter="data")
            unpacked = {file.name for file in (alone / archive.stem).iterdir()}
            self.assertLessEqual({"LICENSE-MIT", "LICENSE-APACHE"}, unpacked, archive.stem)
        for example in (ROOT / "examples/crates").iterdir():
            copy = alone / f"example-{example.name}"
            shutil.copytree(example, copy)
            manifest = (copy / "Cargo.toml").read_text()
            manifest = re.sub(r'\{ path = "\.\./\.\./\.\./crates/\w+"', f'{{ version = "{VERSION}"', manifest)
            self.assertNotIn('"../', manifest)
            (copy / "Cargo.toml").write_text(manifest)
        whole = (self.folder / "Cargo.toml").read_text()
        profiles = whole[whole.index("[profile.dev]"):]
        patches = "".join(f'{name} = {{ path = "{name}-{VERSION}" }}\n' for name in sorted(PUBLISHED))
        manifest = f'[workspace]\nresolver = "3"\nmembers = ["*"]\n\n[patch.crates-io]\n{patches}\n{profiles}'
        (alone / "Cargo.toml").write_text(manifest)
        self.check(alone, "--workspace", "--bins", "--lib")

    def check(self, folder, *words):
        """Compiles an unpacked workspace with the dependencies that the folder `target` holds."""
        # Archives have one fixed time, so that cargo would take the files of an earlier archive for these.
        for file in folder.rglob("*.rs"):
            file.touch()
        if not (folder / "Cargo.lock").exists():
            shutil.copy2(self.folder / "Cargo.lock", folder)
        check = ["cargo", "check", "--offline", *words, "--target-dir", ROOT / "target"]
        done = subprocess.run(check, cwd=folder, capture_output=True, text=True, timeout=MINUTES, check=False)
        self.assertEqual(done.returncode, 0, done.stderr[-4000:])

    def test_a_source_distribution_builds_without_the_tree(self):
        run("sh", self.folder / ".github/embed.sh", "crates", folder=self.folder)
        words = [MATURIN, "sdist", "--manifest-path", self.folder / "python/Cargo.toml", "--out", "dist"]
        done = subprocess.run(words, cwd=self.folder, capture_output=True, text=True, timeout=MINUTES, check=False)
        self.assertEqual(done.returncode, 0, done.stderr[-4000:])
        [file] = (self.folder / "dist").iterdir()
        # CONTRIBUTING.md downloads this name.
        self.assertEqual(file.name, f"tautline-{VERSION}.tar.gz")
        alone = new_folder(self)
        with tarfile.open(file) as files:
            files.extractall(alone, filter="data")
        source = alone / f"tautline-{VERSION}"
        manifests = {f"crates/{crate.removeprefix('tautline-')}/Cargo.toml" for crate in PUBLISHED - {"tautline"}}
        for name in manifests | {"Cargo.lock", "pyproject.toml", "PKG-INFO"}:
            self.assertTrue((source / name).is_file(), name)
        self.check(source, "--package", "tautline-python")

    def test_the_repository_is_written_into_each_package_and_manifests_are_restored(self):
        manifests = [self.folder / "Cargo.toml", *self.folder.glob("crates/*/Cargo.toml")]
        before = [manifest.read_bytes() for manifest in manifests]
        url, packed = "https://example.invalid/owner/tautline", self.folder / "packed"
        done = self.crates("package", "--offline", "--no-verify", "--target-dir", str(packed), REPOSITORY=url)
        self.assertEqual(done.returncode, 0, done.stderr)
        having = set()
        for archive in (packed / "package").glob("*.crate"):
            with tarfile.open(archive) as files:
                manifest = files.extractfile(f"{archive.stem}/Cargo.toml").read().decode()
            if f'\nrepository = "{url}"\n' in manifest:
                having.add(archive.stem.removesuffix(f"-{VERSION}"))
        self.assertEqual(having, PUBLISHED)
        self.assertEqual([manifest.read_bytes() for manifest in manifests], before)

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


class Publishing(Copied):
    """Publishes to a registry that a program `cargo` on PATH imitates. The files of REGISTRY are published crates."""

    CARGO = """#!/bin/sh
echo "$*" >>"$REGISTRY/calls"
[ "$1 $2" = "publish --package" ] || exit 0
grep -q '^repository = "https://example.invalid/"' Cargo.toml || { echo "no repository" >&2; exit 101; }
if [ -e "$REGISTRY/$3" ]; then
    echo "error: crate $3@0.1.0 already exists on crates.io index" >&2
    exit 101
fi
case " $BROKEN " in *" $3 "*) echo "error: failed to verify package tarball" >&2; exit 101 ;; esac
if [ "$(ls "$REGISTRY" | grep -c ^tautline)" -ge 5 ] && [ ! -e "$REGISTRY/refused-$3" ]; then
    touch "$REGISTRY/refused-$3"
    echo "  the remote server responded with an error (status 429 Too Many Requests): You have published too many" >&2
    exit 101
fi
touch "$REGISTRY/$3"
"""

    def setUp(self):
        super().setUp()
        self.registry = self.folder / "registry"
        self.registry.mkdir()
        program = self.folder / "path/cargo"
        program.parent.mkdir()
        program.write_text(self.CARGO)
        program.chmod(0o755)

    def publish(self, *words, broken=""):
        """Returns the finished process and the arguments of each call of cargo."""
        path = os.pathsep.join([str(self.folder / "path"), os.environ["PATH"]])
        environment = {"PATH": path, "REGISTRY": str(self.registry), "BROKEN": broken, "WAIT_S": "0"}
        done = run("sh", self.folder / ".github/crates.sh", "publish", "--locked", *words, folder=self.folder,
                   REPOSITORY="https://example.invalid/", **environment)
        return done, (self.registry / "calls").read_text().splitlines()

    def published(self):
        return {file.name for file in self.registry.glob("tautline*")}

    def test_crates_are_published_after_their_dependencies(self):
        done, calls = self.publish()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.published(), PUBLISHED)
        words = ["cargo", "metadata", "--no-deps", "--offline", "--format-version", "1"]
        listed = json.loads(subprocess.run(words, cwd=ROOT, capture_output=True, check=True).stdout)
        needed = {of["name"]: PUBLISHED & {to["name"] for to in of["dependencies"]} for of in listed["packages"]}
        order = list(dict.fromkeys(call.split()[2] for call in calls))
        for position, crate in enumerate(order):
            self.assertLessEqual(needed[crate], set(order[:position]), crate)
            self.assertIn(f"publish --package {crate} --allow-dirty --locked", calls)

    def test_a_refused_crate_is_tried_again(self):
        done, calls = self.publish()
        self.assertEqual(len(calls), len(PUBLISHED) + len(PUBLISHED) - 5)
        self.assertEqual(done.stderr.count("attempt 2 follows in 0 s"), len(PUBLISHED) - 5)

    def test_a_failed_run_is_resumed(self):
        before = (self.folder / "Cargo.toml").read_bytes()
        done, calls = self.publish(broken="tautline-sim")
        self.assertEqual(done.returncode, 1)
        self.assertIn("tautline-sim: not published; repeat the command", done.stderr)
        self.assertIn("failed to verify package tarball", done.stderr)
        self.assertIn("--package tautline-sim", calls[-1])
        self.assertNotIn("tautline", self.published())
        self.assertEqual((self.folder / "Cargo.toml").read_bytes(), before)
        some = self.published()
        done, _ = self.publish()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.published(), PUBLISHED)
        skipped = set(re.findall("^(.*): skipped, already published$", done.stdout, re.MULTILINE))
        self.assertEqual(skipped, some)

    def test_a_dry_run_is_one_call(self):
        done, [call] = self.publish("--dry-run")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue(call.startswith("publish --workspace --exclude "), call)
        self.assertEqual(self.published(), set())


class Workflows(unittest.TestCase):
    FILES = sorted((ROOT / ".github/workflows").glob("*.yml"))

    def test_shell_scripts_parse(self):
        blocks = [(file, file.read_text()) for file in (ROOT / ".github").glob("*.sh")]
        for file in self.FILES:
            for name, job in yaml.safe_load(file.read_text())["jobs"].items():
                blocks += [(f"{file}: {name}", step["run"]) for step in job["steps"] if "run" in step]
        self.assertGreater(len(blocks), 20)
        for place, script in blocks:
            script = re.sub(r"\$\{\{.*?\}\}", "expression", script)
            done = subprocess.run(["bash", "-n"], input=script, capture_output=True, text=True, check=False)
            self.assertEqual((done.returncode, done.stderr), (0, ""), place)

    def test_actions_are_pinned_by_commit(self):
        for file in self.FILES:
            for line in re.findall(r"uses: .*", file.read_text()):
                self.assertRegex(line, r"^uses: \S+@[0-9a-f]{40} # v\d+\.\d+\.\d+$", file)

    def test_jobs_that_need_an_account_run_in_the_environment_release(self):
        for name, job in yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text())["jobs"].items():
            has_account = {"id-token", "packages"} & job.get("permissions", {}).keys()
            self.assertEqual(job.get("environment"), "release" if has_account else None, name)


class SupplyChain(unittest.TestCase):
    def check(self, config):
        with tempfile.NamedTemporaryFile("w", suffix=".toml") as file:
            file.write(config)
            file.flush()
            words = [DENY, "--offline", "--config", file.name, "check", "--hide-inclusion-graph"]
            return run(*words, "bans", "licenses", "sources", folder=ROOT)

    def test_notices_accept_the_same_licences(self):
        def licences(text, key):
            return re.findall(r'"(.*)"', text[text.index(f"\n{key} = ["):].split("]")[0])

        accepted = licences((ROOT / ".github/about.toml").read_text(), "accepted")
        self.assertEqual(accepted, licences((ROOT / "deny.toml").read_text(), "allow"))

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
        self.folder = new_folder(self)
        self.notices = self.folder / "notices.txt"
        self.notices.write_text("licences of libraries\n")

    def pack(self, program, *words):
        return run("sh", ROOT / ".github/package.sh", program, TARGET, *words, folder=self.folder,
                   NOTICES=str(self.notices))

    def test_an_archive_flies_the_ten_minute_tour(self):
        environment = {"RELEASES": self.folder.as_uri()}
        done = self.pack(PROGRAM, self.folder)
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
        done = self.pack(PROGRAM, self.folder, "viewer")
        self.assertEqual(pathlib.Path(done.stdout.strip()).name, f"tautline-{VERSION}-{TARGET}-viewer.tar.gz")

    def test_an_archive_has_all_licences(self):
        with tarfile.open(self.pack(PROGRAM, self.folder).stdout.strip()) as files:
            names = {pathlib.Path(name).name for name in files.getnames()}
        self.assertLessEqual({"LICENSE-MIT", "LICENSE-APACHE", "THIRD-PARTY.txt"}, names)
        self.notices.unlink()
        done = self.pack(PROGRAM, self.folder)
        self.assertEqual(done.returncode, 2)
        self.assertIn("notices.txt: missing; sh .github/notices.sh Cargo.toml writes it", done.stderr)

    def test_the_smoke_test_starts_an_archive(self):
        done = self.pack(PROGRAM, "dist")
        archive = self.folder / done.stdout.strip()
        done = run("sh", ROOT / ".github/smoke.sh", archive, folder=self.folder)
        self.assertEqual((done.returncode, done.stdout), (0, f"{archive}: started\n"), done.stderr)
        done = run("sh", ROOT / ".github/smoke.sh", "tautline.zip", folder=self.folder)
        self.assertEqual(done.returncode, 2)
        self.assertIn("must be an archive, a wheel or the source distribution", done.stderr)

    def test_the_smoke_test_refuses_another_version(self):
        program = self.folder / "tautline"
        program.write_text("#!/bin/sh\necho tautline 9.9.9\n")
        program.chmod(0o755)
        done = self.pack(program, "dist")
        done = run("sh", ROOT / ".github/smoke.sh", done.stdout.strip(), folder=self.folder)
        self.assertEqual(done.returncode, 1)
        self.assertIn(f'has the version "tautline 9.9.9", must be "tautline {VERSION}"', done.stderr)

    def test_a_wheel_works_in_a_clean_environment(self):
        run("sh", ROOT / ".github/embed.sh", "wheel", folder=ROOT)
        self.addCleanup(run, "sh", ROOT / ".github/embed.sh", "remove", folder=ROOT)
        words = [MATURIN, "build", "--manifest-path", ROOT / "python/Cargo.toml", "--out", "dist"]
        done = subprocess.run(words, cwd=self.folder, capture_output=True, text=True, timeout=MINUTES, check=False)
        self.assertEqual(done.returncode, 0, done.stderr[-4000:])
        [wheel] = (self.folder / "dist").glob("*.whl")
        self.assertRegex(wheel.name, rf"^tautline-{re.escape(VERSION)}-cp310-abi3-")
        with zipfile.ZipFile(wheel) as files:
            [metadata] = [name for name in files.namelist() if name.endswith(".dist-info/METADATA")]
            licences = [name for name in files.namelist() if "/licenses/" in name]
            text = files.read(metadata).decode()
        self.assertGreaterEqual({pathlib.Path(name).name for name in licences}, {"LICENSE-MIT", "LICENSE-APACHE"})
        self.assertRegex(text, "(?m)^Author: The tautline developers$")
        self.assertRegex(text, "(?m)^Project-URL: Repository, https://github.com/OWNER/tautline$")
        done = run("sh", ROOT / ".github/smoke.sh", wheel, folder=self.folder, PYTHON=sys.executable)
        self.assertEqual(done.returncode, 0, done.stderr)
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
