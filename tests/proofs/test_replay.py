"""Tests of `proofs/replay`: logs of shielded flights are confirmed, and changed copies of a log are refused.

Usage: `sh proofs/check.sh && python -m unittest discover --start-directory tests/proofs`. TAUTLINE is the program
[target/debug/tautline].
"""

import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest
import zlib

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(os.environ.get("TAUTLINE", ROOT / "target/debug/tautline")).resolve()
REPLAY = ROOT / "proofs/replay"
RADIO = ["network." + text for text in ("rate_hz=20", "latency_s=0.1", "jitter_s=0.05", "loss=0.3", "loss_burst=3")]
SWAP = ["law.kind=laplacian", "shield.enabled=true"]


def tautline(*words):
    return subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True, timeout=600)


def replay(path):
    return subprocess.run([REPLAY, str(path)], capture_output=True, text=True, timeout=600)


class InFolder(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder)

    @classmethod
    def fly(cls, name, scenario, *settings):
        """Flies a scenario with a log, and returns the path of the log and the report."""
        log, out = cls.folder / f"{name}.log", cls.folder / name
        words = [word for text in settings for word in ("--set", text)]
        done = tautline("run", scenario, *words, "--no-snapshots", "--no-figures", "--out", out, "--contract-log", log)
        assert done.returncode in (0, 1), done.stderr
        return log, json.loads((out / "report.json").read_text())


class Confirmed(InFolder):
    def check(self, log, report):
        done = replay(log)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertTrue(done.stdout.startswith("CONFIRMED: vehicles within "), done.stdout)
        shield = report["shield"]
        lines = log.read_text().splitlines()
        kinds = [line.split()[0] for line in lines]
        self.assertIn(f"{kinds.count('send')} messages sent, {kinds.count('hear')} received", done.stdout)
        answers = [line.split()[4] for line in lines if line.startswith("decide")]
        decided = [shield["proposals_accepted"], shield["proposals_refused"]]
        self.assertEqual([answers.count("yes"), answers.count("no")], decided)
        self.assertEqual(kinds.count("send"), shield["messages_sent"])
        self.assertGreater(kinds.count("take"), 0)
        return kinds

    def test_each_shielded_built_in_scenario_is_confirmed(self):
        names = [one["name"] for one in json.loads(tautline("list", "--json").stdout)]
        shielded = [name for name in names if "\n[shield]" in tautline("list", "--show", name).stdout]
        self.assertIn("shielded-crazyflies", shielded)
        for name in shielded:
            with self.subTest(name):
                self.check(*self.fly(name, name))

    def test_a_flight_with_a_radio_that_delays_and_loses_messages_is_confirmed(self):
        kinds = self.check(*self.fly("radio", "swap", *SWAP, *RADIO, "time.duration_s=20"))
        self.assertLess(kinds.count("hear"), 0.8 * kinds.count("send"))

    def test_a_flight_of_ellipsoids_is_confirmed_in_scaled_lengths(self):
        shape = ['safety.shape="ellipsoid"', "safety.half_axes_m=[0.5, 0.5, 0.8]"]
        log, report = self.fly("ellipsoids", "swap", *SWAP, *shape, "time.duration_s=12")
        self.check(log, report)
        self.assertIn("in scaled lengths", replay(log).stdout)

    def test_a_log_changes_no_bit_of_the_flight_and_has_the_same_bytes_each_time(self):
        logs = [self.fly(name, "swap", *SWAP, "time.duration_s=5") for name in ("one", "other")]
        self.assertEqual(logs[0][0].read_bytes(), logs[1][0].read_bytes())
        out = self.folder / "bare"
        words = [word for text in [*SWAP, "time.duration_s=5"] for word in ("--set", text)]
        tautline("run", "swap", *words, "--no-snapshots", "--no-figures", "--out", out)
        report = json.loads((out / "report.json").read_text())
        self.assertEqual(report["run"]["state_hash"], logs[0][1]["run"]["state_hash"])


class Arguments(InFolder):
    def test_a_scenario_without_a_shield_has_no_log(self):
        log = self.folder / "none.log"
        done = tautline("run", "pentagon", "--out", self.folder / "bare", "--contract-log", log)
        self.assertEqual(done.returncode, 2)
        self.assertIn("--contract-log: the scenario `pentagon` has no shield", done.stderr)
        self.assertIn("set shield.enabled=true", done.stderr)
        self.assertFalse(log.exists() or (self.folder / "bare").exists())

    def test_a_flight_with_hangs_is_refused(self):
        log = self.folder / "hangs.log"
        words = ["--set", "law.kind=laplacian", "--set", "shield={hang_periods=3, hang_share=0.5}"]
        done = tautline("run", "swap", *words, "--out", self.folder / "bare", "--contract-log", log)
        self.assertEqual(done.returncode, 2)
        self.assertIn("set shield.hang_share=0", done.stderr)
        self.assertFalse(log.exists() or (self.folder / "bare").exists())

    def test_an_existing_file_and_standard_output_are_refused(self):
        log = self.folder / "there.log"
        log.write_text("kept")
        inside = self.folder / "out/report.json"
        for place, message in [(log, "exists"), ("-", "cannot go to standard output"), (inside, "is in the folder")]:
            done = tautline("run", "shielded-crazyflies", "--out", self.folder / "out", "--contract-log", place)
            self.assertEqual(done.returncode, 2)
            self.assertIn(message, done.stderr)
        self.assertEqual(log.read_text(), "kept")

    def test_files_that_are_no_log_are_named(self):
        self.assertEqual(subprocess.run([REPLAY], capture_output=True).returncode, 2)
        done = replay(self.folder / "missing")
        self.assertEqual(done.returncode, 2)
        self.assertIn("cannot read", done.stderr)
        for content in (b"", b"\n", b"tautline contract log 2\n", b"\0\xff" * 100, b"tautline contract log 1\n"):
            path = self.folder / "other"
            path.write_bytes(content)
            done = replay(path)
            self.assertEqual(done.returncode, 2, done.stdout)
            self.assertNotIn("CONFIRMED", done.stdout)


class Log:
    """Lines of a log: changes return the lines with the counts of the events that are left."""

    def __init__(self, lines):
        self.lines = lines
        self.first_event = next(k for k, line in enumerate(lines) if line.startswith("instant"))

    def find(self, kind, accepts=lambda words: True, after=0):
        """Place and words of the first event of a kind."""
        for place in range(max(after, self.first_event), len(self.lines)):
            words = self.lines[place].split()
            if words[0] == kind and accepts(words):
                return place, words
        raise AssertionError(f"no {kind}")

    def replaced(self, place, *lines):
        """Lines with others in the place of one."""
        return counted(self.lines[:place] + list(lines) + self.lines[place + 1 :], self.first_event)

    def changed(self, kind, column, value, accepts=lambda words: True):
        """Lines with another word in the first event of a kind."""
        place, words = self.find(kind, accepts)
        words[column] = value(words[column]) if callable(value) else value
        return self.replaced(place, " ".join(words))

    def header(self, kind, column, value):
        """Lines with another word in the first line of a kind above the events."""
        place = next(k for k, line in enumerate(self.lines) if line.startswith(f"{kind} "))
        words = self.lines[place].split()
        words[column] = value(words[column]) if callable(value) else value
        return checked(self.lines[:place] + [" ".join(words)] + self.lines[place + 1 :])


def checked(lines):
    """Lines with the CRC-32 of those before the last one."""
    check = zlib.crc32("".join(f"{line}\n" for line in lines[:-1]).encode())
    return [*lines[:-1], " ".join([*lines[-1].split()[:5], f"{check:08x}"])]


def counted(lines, first_event):
    """Lines with the numbers of events and the CRC-32."""
    events = [line.split()[0] for line in lines[first_event:-1]]
    numbers = [len(events), *(events.count(kind) for kind in ("instant", "send", "hear"))]
    return checked([*lines[:-1], "end " + " ".join(map(str, numbers))])


def flipped(bits):
    """A double with another last bit of its fraction."""
    return f"{int(bits, 16) ^ 1:016x}"


def farther(bits):
    """A double 16 times as large."""
    return f"{int(bits, 16) + (4 << 52):016x}"


def next_number(word):
    return str(int(word) + 1)


def other(word):
    return {"yes": "no", "no": "yes"}[word]


def has_plane(words):
    return words[5] != "none" and int(words[1]) < int(words[2])


def hears_plane(words):
    return words[5] != "none" and int(words[1]) > int(words[2])


class Refused(InFolder):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        path, _ = cls.fly("flown", "swap", *SWAP, *RADIO, "time.duration_s=10")
        cls.log = Log(path.read_text().splitlines())

    def result(self, lines, end="\n"):
        path = self.folder / "changed.log"
        path.write_text("\n".join(lines) + end)
        return replay(path)

    def denied(self, lines, why):
        done = self.result(lines)
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        self.assertTrue(done.stdout.startswith("DENIED: "), done.stdout)
        self.assertIn(why, done.stdout)

    def malformed(self, lines, why, end="\n"):
        done = self.result(lines, end)
        self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
        self.assertNotIn("CONFIRMED", done.stdout)
        self.assertIn(why, done.stdout)

    def test_the_log_itself_and_its_counts_are_right(self):
        self.assertEqual(self.result(self.log.lines).returncode, 0)
        self.assertEqual(counted(self.log.lines, self.log.first_event), self.log.lines)

    def test_an_altered_plane(self):
        self.denied(self.log.changed("propose", 7, flipped), "content is not that of the sender's contract")
        self.denied(self.log.changed("propose", 7, farther), "")
        self.denied(self.log.changed("send", 9, flipped, has_plane), "content is not that of the sender's contract")
        self.denied(self.log.changed("hear", 6, flipped, hears_plane), "no such message was sent")

    def test_an_altered_first_plane_hash_start_or_margin(self):
        self.denied(self.log.header("pair", 7, "4059000000000000"), "first plane of a pair does not contain")
        self.denied(self.log.header("pair", 3, flipped), "hash is not that of the starts")
        self.denied(self.log.header("start", 4, "c059000000000000"), "first plane of a pair does not contain")
        self.denied(self.log.header("start", 2, "3fb0000000000000"), "less than half of the safety distance")

    def test_a_dropped_or_altered_decision(self):
        place, _ = self.log.find("decide")
        self.denied(self.log.replaced(place), "content is not that of the sender's contract")
        yes = self.log.changed("decide", 4, "no", lambda words: words[4] == "yes")
        self.denied(yes, "content is not that of the sender's contract")

    def test_a_decision_before_the_proposal_arrived(self):
        place, words = self.log.find("decide")
        early, instant = self.log.find("instant", lambda other: other[1] == words[1])
        self.assertLess(early, place)
        moved = self.log.lines[: early + 1] + [" ".join(words)] + self.log.lines[early + 1 :]
        self.denied(counted(moved, self.log.first_event), "has heard no proposal with this number")

    def test_a_second_decision(self):
        place, words = self.log.find("decide")
        line = " ".join(words)
        self.denied(self.log.replaced(place, line, line), "decided on this number before")

    def test_a_wrong_number(self):
        self.denied(self.log.changed("propose", 3, next_number), "number of the proposal is not the model's")
        self.denied(self.log.changed("take", 3, next_number), "number of the proposal is not the model's")
        self.denied(self.log.changed("decide", 3, next_number), "has heard no proposal with this number")
        self.denied(self.log.changed("instant", 2, next_number), "period is not the next one")
        self.denied(self.log.changed("send", 3, next_number), "stamp is not the sender's period")

    def test_a_plane_that_is_dropped_too_early(self):
        place, words = self.log.find("propose")
        line = " ".join(words)
        for accepted in ("yes", "no"):
            taken = f"take {' '.join(words[1:4])} {accepted}"
            self.denied(self.log.replaced(place, line, taken), "has not heard the decision")

    def test_a_plane_that_is_dropped_against_the_decision(self):
        self.denied(self.log.changed("take", 4, other), "heard the other decision")

    def test_a_proposal_while_another_is_pending(self):
        place, words = self.log.find("propose")
        self.denied(self.log.replaced(place, " ".join(words), " ".join(words)), "before it took the decision")
        place, _ = self.log.find("take")
        self.denied(self.log.replaced(place), "")

    def test_a_segment_outside(self):
        place, words = self.log.find("reserve", after=len(self.log.lines) // 2)
        _, others = self.log.find("reserve", lambda one: one[1] != words[1], after=place)
        swapped = " ".join(words[:2] + others[2:])
        self.denied(self.log.replaced(place, swapped), "plane that the vehicle holds does not contain the segment")

    def test_a_missing_instant(self):
        place, words = self.log.find("instant", after=len(self.log.lines) // 2)
        self.denied(self.log.replaced(place), "not at an instant")
        end, _ = self.log.find("reserve", lambda one: one[1] == words[1], after=place)
        self.denied(self.log.replaced(end), "")

    def test_an_invented_message(self):
        for column, value in ((3, "999"), (5, next_number)):
            self.denied(self.log.changed("hear", column, value, hears_plane), "no such message was sent")
        place, words = self.log.find("hear", lambda words: words[-1] in ("yes", "no"))
        words[-1] = other(words[-1])
        self.denied(self.log.replaced(place, self.log.lines[place], " ".join(words)), "no such message was sent")

    def test_a_message_that_arrives_before_it_is_sent(self):
        place, words = self.log.find("hear")
        sent, _ = self.log.find("send", lambda one: one[1:] == [words[2], words[1], *words[3:]])
        moved = self.log.lines[:sent] + [self.log.lines[place]] + self.log.lines[sent:]
        self.denied(counted(moved, self.log.first_event), "no such message was sent")

    def test_a_message_that_is_sent_twice_in_an_instant(self):
        place, _ = self.log.find("send")
        line = self.log.lines[place]
        self.denied(self.log.replaced(place, line, line), "has sent a message to this one since its last instant")

    def test_another_hash(self):
        self.denied(self.log.changed("send", 4, flipped), "hash is not that of the starts")
        self.denied(self.log.changed("hear", 4, flipped), "no such message was sent")

    def test_another_vehicle(self):
        for kind, column in (("instant", 1), ("reserve", 1), ("propose", 2), ("take", 2), ("decide", 1), ("hold", 2)):
            self.denied(self.log.changed(kind, column, "77"), "no such vehicle or pair")
        self.denied(self.log.changed("send", 2, "77", has_plane), "no such vehicle or pair")
        self.denied(self.log.changed("hear", 1, "77", hears_plane), "no such vehicle or pair")

    def test_planes_at_the_end(self):
        place, words = self.log.find("hold")
        self.denied(self.log.replaced(place), "planes at the end of a vehicle are missing")
        self.denied(self.log.changed("hold", 6, flipped), "planes are not those that the vehicle holds")
        self.denied(self.log.replaced(place, f"foreign {words[1]} {words[2]}"), "that no event gave it")
        self.denied(self.log.replaced(place, f"moved {words[1]}"), "did not fly the segment that it had reserved")
        instant = f"instant {words[1]} {int(self.log.find('instant', after=place // 2)[1][2]) + 1}"
        self.denied(self.log.replaced(place, " ".join(words), instant), "event follows the planes at the end")

    def test_wrong_counts(self):
        place, _ = self.log.find("hear", after=len(self.log.lines) // 2)
        lines = self.log.lines
        # A message that is lost leads to other events, unless it changes nothing: the counts find it in any case.
        self.denied(checked(lines[:place] + lines[place + 1 :]), "")
        for column in range(1, 5):
            words = lines[-1].split()
            words[column] = next_number(words[column])
            self.denied([*lines[:-1], " ".join(words)], "other numbers of events")

    def test_a_bit_that_the_model_leaves_free(self):
        # The last bit of a stop point inside all planes.
        place, words = self.log.find("reserve")
        words[5] = flipped(words[5])
        lines = self.log.lines[:place] + [" ".join(words)] + self.log.lines[place + 1 :]
        self.assertEqual(self.result(checked(lines)).returncode, 0)
        self.malformed(lines, "a line was altered")

    def test_a_truncated_log_is_not_confirmed(self):
        lines = self.log.lines
        for kept in (len(lines) - 1, len(lines) // 2, self.log.first_event):
            self.malformed(lines[:kept], "it is not complete")
        self.malformed(lines, "the log is not complete", end="")
        self.malformed(lines[:-1] + [lines[-1][:-1]], "the log is not complete", end="")
        self.malformed(lines[:3], "")

    def test_lines_that_cannot_be_read(self):
        lines = self.log.lines
        self.malformed([*lines, "instant 0 1"], "bytes follow the line")
        self.malformed(self.log.changed("reserve", 2, "7ff8000000000000"), "not a finite number")
        self.malformed(self.log.changed("reserve", 2, "7ff0000000000000"), "not a finite number")
        self.malformed(self.log.changed("reserve", 2, "1.5"), "not 16 lower-case hexadecimal digits")
        self.malformed(self.log.changed("reserve", 1, "-1"), "not a whole number")
        self.malformed(self.log.changed("instant", 2, "1 "), "")
        self.malformed(self.log.changed("decide", 4, "maybe"), "neither yes nor no")
        self.malformed(self.log.header("vertical", 1, "0000000000000000"), "must be above 0")
        first_pair = next(k for k, line in enumerate(lines) if line.startswith("pair"))
        self.malformed(lines[:first_pair] + lines[first_pair + 1 :], "first plane of vehicles 0 and 1 is missing")


if __name__ == "__main__":
    unittest.main()
