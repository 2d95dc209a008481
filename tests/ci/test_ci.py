"""Tests of the tools for continuous integration: archives, installer, GitHub action and pre-commit hook.

Usage: `python -m unittest discover --start-directory tests/ci`.

The steps of the action run as on a runner, with archives in a folder. TAUTLINE is the program [target/debug/tautline].
"""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(os.environ.get("TAUTLINE", ROOT / "target/debug/tautline")).resolve()
VERSION = re.search(r'^version = "(.*)"', (ROOT / "Cargo.toml").read_text(), re.MULTILINE).group(1)
TARGET = {"x86_64": "x86_64-unknown-linux-gnu", "aarch64": "aarch64-unknown-linux-gnu"}[os.uname().machine]

_packed = tempfile.TemporaryDirectory()
PACKED = pathlib.Path(_packed.name)

CLEAR = "t,id,x,y,z\n0,a,0,0,0\n0,b,3,0,0\n1,a,0,1,0\n1,b,3,1,0\n"
CROSSING = "t,id,x,y,z\n0,a,0,0,0\n0,b,3,0,0\n1,a,3,0,0\n1,b,0,0,0\n"


def run(*words, folder, **environment):
    return subprocess.run(words, cwd=folder, env=os.environ | environment, capture_output=True, text=True, timeout=120)


class InFolder(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)

    def write(self, name, text):
        file = self.folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)

    def pack(self):
        """Returns an archive of the program in the folder of the test. Packs it once for all tests."""
        if not list(PACKED.glob("*.tar.gz")):
            done = run("sh", ROOT / ".github/package.sh", PROGRAM, TARGET, PACKED, folder=self.folder,
                       NOTICES=str(ROOT / "LICENSE-MIT"))
            self.assertEqual(done.returncode, 0, done.stderr)
        shutil.copytree(PACKED, self.folder / "dist", dirs_exist_ok=True)
        return self.folder / "dist" / f"tautline-{VERSION}-{TARGET}.tar.gz"

    def install(self):
        releases = (self.folder / "dist").as_uri()
        return run("sh", ROOT / ".github/install.sh", f"v{VERSION}", "bin", folder=self.folder, RELEASES=releases)


class Archives(InFolder):
    def test_a_packed_program_is_installed_and_runs(self):
        self.pack()
        done = self.install()
        self.assertEqual(done.returncode, 0, done.stderr)
        version = run(self.folder / "bin/tautline", "--version", folder=self.folder).stdout
        self.assertEqual(version, f"tautline {VERSION}\n")

    def test_an_archive_with_a_wrong_checksum_is_not_installed(self):
        with self.pack().open("ab") as archive:
            archive.write(b"x")
        done = self.install()
        self.assertEqual(done.returncode, 3)
        self.assertIn("differs from its checksum", done.stderr)
        self.assertFalse((self.folder / "bin").exists())

    def test_a_checksum_of_another_file_is_wrong(self):
        archive = self.pack()
        nothing = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855  /dev/null\n"
        archive.with_name(archive.name + ".sha256").write_text(nothing)
        self.assertEqual(self.install().returncode, 3)
        self.assertFalse((self.folder / "bin").exists())

    def test_an_archive_without_the_program_installs_nothing(self):
        archive = self.pack()
        (self.folder / archive.name.removesuffix(".tar.gz")).mkdir()
        run("tar", "-czf", archive, archive.name.removesuffix(".tar.gz"), folder=self.folder)
        sha = run("sha256sum", archive.name, folder=archive.parent).stdout
        archive.with_name(archive.name + ".sha256").write_text(sha)
        done = self.install()
        self.assertEqual(done.returncode, 3)
        self.assertIn("has no tautline", done.stderr)

    def test_a_missing_archive_is_named(self):
        (self.folder / "dist").mkdir()
        done = self.install()
        self.assertEqual(done.returncode, 3)
        self.assertIn(f"tautline-{VERSION}-{TARGET}.tar.gz", done.stderr)

    def test_binstall_and_the_installer_use_the_same_archive(self):
        text = (ROOT / "Cargo.toml").read_text()
        url = re.search(r'^pkg-url = "(.*)"', text, re.MULTILINE).group(1)
        named = url.rsplit("/", 1)[1].replace("{ version }", VERSION).replace("{ target }", TARGET)
        self.assertEqual(named, self.pack().name)
        packed = run("tar", "-tzf", self.folder / "dist" / named, folder=self.folder).stdout.splitlines()
        within = re.search(r'^bin-dir = "(.*)"', text, re.MULTILINE).group(1)
        for name, value in {"version": VERSION, "target": TARGET, "bin": "tautline", "binary-ext": ""}.items():
            within = within.replace("{ %s }" % name, value)
        self.assertIn(within, packed)


class Action(InFolder):
    """Tests of the composite action. `act` evaluates its expressions as a runner does."""

    def act(self, **inputs):
        action = yaml.safe_load((ROOT / "action.yml").read_text())
        given = {name: of.get("default", "") for name, of in action["inputs"].items()} | inputs
        temporary = self.folder / "temporary"
        temporary.mkdir(exist_ok=True)
        context = {
            "github.action_path": str(ROOT),
            "github.action_repository": "owner/tautline",
            "github.server_url": "https://example.invalid",
            "runner.temp": str(temporary),
        } | {f"inputs.{name}": value for name, value in given.items()}
        files = {name: str(self.folder / name) for name in ("GITHUB_PATH", "GITHUB_STEP_SUMMARY")}
        path, output, code = os.environ["PATH"], "", 0
        for step in action["runs"]["steps"]:
            environment = {
                name: re.sub(r"\$\{\{ (\S+) \}\}", lambda of: context[of.group(1)], value)
                for name, value in step["env"].items()
            }
            self.assertNotIn("${{", step["run"], "a runner would execute the value of an expression")
            done = run("bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"], folder=self.folder,
                       PATH=path, **environment, **files)
            output, code = output + done.stdout + done.stderr, done.returncode
            if code:
                break
            added = self.folder / "GITHUB_PATH"
            path = os.pathsep.join([*added.read_text().split(), os.environ["PATH"]])
        return code, output

    def releases(self):
        return self.pack().parent.as_uri()

    def test_recordings_are_audited_with_summary_and_annotations(self):
        self.write("flights/a.csv", CLEAR)
        self.write("flights/b.csv", CROSSING)
        code, output = self.act(recordings="flights/*.csv", arguments="--delta 1.5", releases=self.releases())
        self.assertEqual(code, 1, output)
        self.assertIn("::notice file=flights/a.csv,title=CLEAR if straight between samples::", output)
        self.assertIn("::error file=flights/b.csv,title=VIOLATION::VIOLATION: a and b came to 0.000 m", output)
        summary = (self.folder / "GITHUB_STEP_SUMMARY").read_text()
        self.assertEqual(summary.count("<details"), 2)
        self.assertIn("VIOLATION", summary)

    def test_a_tautline_toml_beside_the_data_is_used(self):
        self.write("flights/a.csv", CLEAR)
        self.write("tautline.toml", "[audit]\ndelta_m = 1.5\n[audit.limits]\nspeed_m_s = 0.5\n")
        code, output = self.act(recordings="flights/a.csv", releases=self.releases())
        self.assertEqual(code, 1, output)
        self.assertIn("speed of a was 1.000 m/s", output)

    def test_inputs_are_never_executed(self):
        self.write("a.csv", CLEAR)
        hostile = "a.csv;touch${IFS}ran $(touch ran) `touch ran`"
        code, _ = self.act(recordings=hostile, arguments="--delta 1.5 $(touch ran)", releases=self.releases())
        self.assertEqual(code, 2)
        self.assertFalse((self.folder / "ran").exists())

    def test_a_missing_recording_is_an_error(self):
        code, output = self.act(recordings="flights/*.csv", releases=self.releases())
        self.assertEqual(code, 2)
        self.assertIn("there is no recording flights/*.csv", output)
        self.write("a.csv", CLEAR)
        code, _ = self.act(recordings="a.csv shows/*.skyc", arguments="--delta 1.5", releases=self.releases())
        self.assertEqual(code, 2, "a pattern without files is an error")
        code, _ = self.act(recordings=" ", releases=self.releases())
        self.assertEqual(code, 2)


class Hook(InFolder):
    def test_the_manifest_is_valid_and_its_entry_audits_files(self):
        pre_commit = [sys.executable, "-m", "pre_commit"]
        done = run(*pre_commit, "validate-manifest", ROOT / ".pre-commit-hooks.yaml", folder=self.folder)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        [hook] = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())
        self.write("a.csv", CLEAR)
        self.write("b.csv", CROSSING)
        files = [name for name in ("a.csv", "b.csv", "notes.md") if re.search(hook["files"], name)]
        program, *words = hook["entry"].split()
        self.assertEqual(program, "tautline")
        self.assertEqual(hook["args"][-1], "--")
        done = run(PROGRAM, *words, "--delta", "1.5", *hook["args"], *files, folder=self.folder)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("1 recording clear, 1 violation, 0 undecided", done.stdout)


class Workflows(unittest.TestCase):
    def test_workflows_parse_and_their_scripts_exist(self):
        for file in sorted((ROOT / ".github/workflows").glob("*.yml")):
            workflow = yaml.safe_load(file.read_text())
            self.assertTrue(workflow["jobs"], file)
            for called in re.findall(r"(?:sh |run: )((?:source/)?\.\w+/\S+)", file.read_text()):
                self.assertTrue((ROOT / called.removeprefix("source/")).is_file(), f"{file.name} calls {called}")

    def phases(self):
        """Returns the phases of tests/run.sh."""
        script = (ROOT / "tests/run.sh").read_text()
        change, = re.findall(r'^change="(.*)"$', script, re.MULTILINE)
        others, = re.findall(r'^all="\$change (.*)"$', script, re.MULTILINE)
        return change.split() + others.split()

    def test_every_phase_of_the_tests_is_a_job_and_a_row_of_the_page(self):
        jobs = yaml.safe_load((ROOT / ".github/workflows/check.yml").read_text())["jobs"]
        listed = [name for names in jobs["tests"]["strategy"]["matrix"]["phases"] for name in names.split()]
        self.assertCountEqual(listed, self.phases())
        page = (ROOT / "CONTRIBUTING.md").read_text()
        rows = re.findall(r"^\| `(\w+)` \| .* \| (?:\d+|–) \|$", page, re.MULTILINE)
        self.assertEqual(rows, ["set_up", *self.phases()])

    def test_an_unknown_phase_is_refused(self):
        done = run("sh", ROOT / "tests/run.sh", "--only", "bits", "bots", folder=ROOT)
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn("bots: no such phase; give some of: crates ", done.stderr)

    def test_other_systems_test_every_crate(self):
        jobs = yaml.safe_load((ROOT / ".github/workflows/check.yml").read_text())["jobs"]
        [tests] = [step["run"] for step in jobs["systems"]["steps"] if "cargo test" in step.get("run", "")]
        crates = [f"tautline-{folder.name}" for folder in (ROOT / "crates").iterdir()]
        self.assertCountEqual(re.findall(r"--package (\S+)", tests), crates)

    def test_the_oldest_compiler_is_that_of_the_manifest(self):
        jobs = yaml.safe_load((ROOT / ".github/workflows/check.yml").read_text())["jobs"]
        script = jobs["oldest-rust"]["steps"][-1]["run"]
        found = run("sh", "-c", script.splitlines()[0] + '; echo "$version"', folder=ROOT)
        self.assertIn(f'rust-version = "{found.stdout.strip()}"', (ROOT / "Cargo.toml").read_text())
        self.assertRegex(found.stdout, r"^\d+\.\d+\n$")

    def test_released_and_installed_targets_are_the_same(self):
        release = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text())
        targets = {of["target"] for of in release["jobs"]["program"]["strategy"]["matrix"]["include"]}
        script = (ROOT / ".github/install.sh").read_text()
        systems = re.findall(r"system=(\S+)", script)
        machines = re.findall(r"machine=(\w+)", script)
        known = {f"{machine}-{system}" for system in systems for machine in machines}
        self.assertEqual(targets, known)


class Audits(InFolder):
    def audit(self, *words):
        return run(PROGRAM, "audit", *words, folder=self.folder)

    def test_each_recording_has_a_verdict_and_the_worst_exit_code_counts(self):
        self.write("a.csv", CLEAR)
        self.write("b.csv", CROSSING)
        self.write("c.csv", "t,id,x,y\nnonsense\n")
        self.assertEqual(self.audit("a.csv", "--delta", "1.5").returncode, 0)
        self.assertEqual(self.audit("a.csv", "b.csv", "--delta", "1.5").returncode, 1)
        reports = ["--json", "--summary", "s.md", "--annotations", "github"]
        done = self.audit("a.csv", "b.csv", "c.csv", "--delta", "1.5", *reports)
        self.assertEqual(done.returncode, 2)
        self.assertEqual([of.get("status") for of in json.loads(done.stdout)], ["clear", "violation", None])
        self.assertEqual(done.stderr.count("::error file="), 2)
        self.assertIn("not judged", (self.folder / "s.md").read_text())

    def test_input_files_are_not_overwritten(self):
        self.write("a.csv", CLEAR)
        self.write("b.csv", CLEAR)
        self.write("fence.toml", "[fence]\npolygon_m = [[-9, -9], [9, -9], [9, 9], [-9, 9]]\n")
        settings = '[audit]\ndelta_m = 1.5\nfence = "fence.toml"\n'
        self.write("tautline.toml", settings)
        for recordings in (["a.csv"], ["a.csv", "b.csv"]):
            for option in ("--summary", "--junit", "--events"):
                for kept in ("fence.toml", "tautline.toml"):
                    before = (self.folder / kept).read_text()
                    done = self.audit(*recordings, option, kept)
                    self.assertEqual(done.returncode, 2, (option, kept))
                    self.assertIn("would overwrite", done.stderr)
                    self.assertEqual((self.folder / kept).read_text(), before)

    def test_names_in_the_log_are_not_commands_of_the_runner(self):
        hostile = ["::stop-commands::x", "y ##[error]z", "a\n::error title=pwn::pwned"]
        rows = [f'{t},"{name}",{3 * k},{t},0' for t in (0, 1) for k, name in enumerate(hostile)]
        self.write("a.csv", "t,id,x,y,z\n" + "\n".join(rows) + "\n")
        self.write("::stop-commands::b.csv", "t,id,x,y\nnonsense\n")
        done = self.audit("a.csv", "::stop-commands::b.csv", "--delta", "5", "--annotations", "github")
        lines = [line.strip() for line in (done.stdout + done.stderr).splitlines()]
        self.assertNotIn("##[", done.stdout + done.stderr)
        self.assertEqual([line.split(" ")[0] for line in lines if line.startswith("::")], ["::error", "::error"])
        self.assertTrue(all("title=pwn" not in line.split("::")[1] for line in lines if line.startswith("::")))

    def test_a_summary_is_appended(self):
        self.write("a.csv", CLEAR)
        self.write("s.md", "# Mine\n")
        self.assertEqual(self.audit("a.csv", "--delta", "1.5", "--summary", "s.md").returncode, 0)
        self.assertRegex((self.folder / "s.md").read_text(), r"^# Mine\n## tautline audit\n")

    def test_every_path_of_a_recording_finds_the_same_tautline_toml(self):
        self.write("real/flights/a.csv", CLEAR)
        self.write("real/tautline.toml", "[audit]\ndelta_m = 9.0\n")
        (self.folder / "link").symlink_to("real")
        linked = self.folder / "link/flights/a.csv"
        for name in ("flights/a.csv", "flights/../flights/a.csv", linked, "./flights/a.csv"):
            done = run(PROGRAM, "audit", name, "--limit", "speed=9", folder=self.folder / "link")
            self.assertEqual(done.returncode, 1, name)
        (self.folder / "real/tautline.toml").unlink()
        (self.folder / "real/tautline.toml").mkdir()
        done = run(PROGRAM, "audit", "flights/a.csv", "--delta", "1", folder=self.folder / "real")
        self.assertEqual(done.returncode, 2)

    def test_the_nearest_tautline_toml_is_used_and_noted(self):
        self.write("flights/deep/a.csv", CLEAR)
        self.write("tautline.toml", "[audit]\ndelta_m = 9.0\n")
        self.assertEqual(self.audit("flights/deep/a.csv").returncode, 1)
        self.write("flights/tautline.toml", "[audit]\ndelta_m = 1.0\n")
        done = self.audit("flights/deep/a.csv", "--json")
        self.assertEqual(done.returncode, 0)
        note = "options that the command line does not set come from flights/tautline.toml: delta_m"
        self.assertIn(note, json.loads(done.stdout)["notes"])
        self.assertEqual(self.audit("flights/deep/a.csv", "--delta", "9").returncode, 1)
        self.assertEqual(self.audit("flights/deep/a.csv", "--no-config").returncode, 2)
        self.assertEqual(self.audit("flights/deep/a.csv", "--config", "tautline.toml").returncode, 1)
        self.write("flights/tautline.toml", "[audit]\ndelta = 1.0\n")
        done = self.audit("flights/deep/a.csv")
        self.assertEqual(done.returncode, 2)
        self.assertIn("flights/tautline.toml, line 2: unknown field `delta`", done.stderr)


if __name__ == "__main__":
    unittest.main()
