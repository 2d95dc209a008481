"""Tests of the checker of proofs.

Usage: `python3 proofs.py check_proof.py FOLDER`, where FOLDER holds NAME.json, and NAME.csv or a folder NAME.

Each proof of the folder is confirmed, or refused where NAME.json is followed by NAME.refused; it is denied after each
alteration. The tests of the classes write proofs of their own.
"""

import contextlib
import copy
import hashlib
import importlib.util
import io
import json
import math
import random
import struct
import sys
import time
import unittest
from fractions import Fraction
from pathlib import Path

CHECKER, FOLDER = sys.argv[1:]
SPEC = importlib.util.spec_from_file_location("check_proof", CHECKER)
check_proof = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(check_proof)

CONFIRMED, DENIED, UNREADABLE = 0, 1, 2
MISSING = object()
# Values that replace each value of a proof.
WRONG = [MISSING, None, True, False, -1, 0, 1, 2, 7, -0.0, -0.5, 0.5, 1e308, -1e308, 5e-324, 10**400, -(2**63), 8e24]
WRONG += [math.nan, math.inf, -math.inf, "", "x", "a", "b", "3.0", "NaN", "\ud800", "clear", "violation", "undecided"]
WRONG += ["s", "ms", "us", "ns", "hold", [], {}, [1], ["a"], [[]], {"a": 1}, ["a", "b"], ["b", "a"], ["a", "a"]]
# Texts of numbers that `json.dumps` does not write.
TEXTS = ["1e400", "-1e400", "1e-401", "1e999999999", "1e-999999999", "-0.0", "-0", "0e0", "9" * 5000, "0." + "1" * 5000]
TEXTS += ["NaN", "Infinity", "8e24", "8000000000000000000000000", "true"]


def table(header="t,id,x,y,z", row="{t},{id},{x},{y},0", ids=("a", "b"), times=range(10)):
    """Rows of two vehicles that pass each other 3 m apart at 4.5 s."""
    rows = [row.format(t=time, id=ids[0], x=k, y=0) for k, time in enumerate(times)]
    rows += [row.format(t=time, id=ids[1], x=9 - k, y=3) for k, time in enumerate(times)]
    return "".join(f"{line}\n" for line in (header, *rows))


def proof_of(text, ids=("a", "b"), gap_s=1.5, **changes):
    """Proof of a `table`, with changed members of its objects."""
    proof = {
        "format": "tautline proof",
        "version": 3,
        "data": {"format": "csv", "recording": "data.csv", "sha256": hashlib.sha256(text.encode()).hexdigest()},
        "claim": {
            "status": "clear",
            "motion": "linear",
            "limits": [
                {
                    "kind": "distance",
                    "status": "clear",
                    "delta_m": 1.0,
                    "radii_m": {},
                    "smallest": 3.0,
                    "pair": list(ids[:2]),
                    "above_m": None,
                }
            ],
        },
        "assumed": {"time_unit": "s", "max_gaps_s": {name: gap_s for name in ids}, "offsets_s": {}},
    }
    for part in (proof["claim"]["limits"][0], proof["claim"], proof["assumed"]):
        part |= {key: changes[key] for key in part.keys() & changes.keys()}
    return proof


def run(proof, data, *options):
    """Returns the exit code and the output of the checker. `proof` is JSON, or the bytes of a file; `data` is one file,
    or a list of them."""
    files = {"proof.json": proof if type(proof) is bytes else json.dumps(proof).encode()}
    for k, content in enumerate(data if type(data) is list else [data]):
        files[f"data{k}.csv"] = content if type(content) is bytes else content.encode()
    check_proof.open = lambda path, mode: io.BytesIO(files[path])
    # The output has the encoding of a terminal without Unicode.
    out, error = io.TextIOWrapper(io.BytesIO(), encoding="ascii"), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        code = check_proof.main([*files, *options])
    out.seek(0)
    return code, out.read() + error.getvalue()


def nodes(value, path=()):
    """Paths of all values within a value of JSON."""
    for key in value if type(value) is dict else range(len(value)) if type(value) is list else ():
        yield (*path, key)
        yield from nodes(value[key], (*path, key))


def at(value, path):
    for key in path:
        value = value[key]
    return value


def changed(proof, path, value):
    other = copy.deepcopy(proof)
    if value is MISSING:
        del at(other, path[:-1])[path[-1]]
    else:
        at(other, path[:-1])[path[-1]] = value
    return other


def reproved(proof, text):
    """Yields proofs with each verdict that the checker could accept under the other facts of a proof: each status, and
    the separation that the checker itself computes."""
    yield proof
    claim = proof.get("claim")
    if type(claim) is not dict:
        return
    limits = claim.get("limits")
    if type(limits) is not list or not limits or type(limits[0]) is not dict:
        return
    for pair in (["a", "b"], ["a", "c"]):
        for status in ("clear", "violation", "undecided"):

            def other(**changes):
                limit = limits[0] | {"pair": pair, "status": status} | changes
                return proof | {"claim": claim | {"status": status, "limits": [limit, *limits[1:]]}}

            yield other()
            # The checker denies with the separation that it computes.
            found = run(other(), text)[1].partition("never closer than ")[2].split(" ")[0]
            if found:
                yield other(smallest=float(found))


def is_true(proof):
    """Whether the claim of a proof of `table()` is true."""
    claim, assumed = proof["claim"], proof["assumed"]
    (limit,) = claim["limits"]
    is_kept = limit["smallest"] == 3 or abs(limit["smallest"] - 3) < 1e-8
    is_kept &= sorted(limit["pair"]) == ["a", "b"] and claim["motion"] == "linear"
    is_kept &= all(by_s == 0 for by_s in assumed["offsets_s"].values())
    # Both vehicles are at the height 0.
    is_kept &= limit["above_m"] is None or limit["above_m"] < 0
    limit_m = max(limit["delta_m"] or 0, sum(limit["radii_m"].values()))
    is_limit = limit_m > 0 and claim["status"] == limit["status"] == ("clear" if limit_m <= 3 else "violation")
    per_second = check_proof.PER_SECOND[assumed["time_unit"]]
    return is_kept and is_limit and all(gap is None or gap * per_second >= 1 for gap in assumed["max_gaps_s"].values())


class Case(unittest.TestCase):
    def expect(self, code, text, proof, message="", *options):
        found, out = run(proof, text, *options)
        self.assertEqual(found, code, out)
        self.assertIn(message, out)
        lines = out.splitlines()
        more = all(line.startswith(("assumes  ", "limit    ")) for line in lines[1:])
        self.assertTrue(out.endswith("\n") and more, out)
        self.assertTrue(len(lines) == 1 or code == CONFIRMED, out)
        return out


class Checker(Case):
    def test_the_output_states_every_fact_that_the_table_does_not_contain(self):
        out = self.expect(CONFIRMED, table(), proof_of(table(), offsets_s={"b": 0.0}))
        self.assertEqual(
            out.splitlines(),
            [
                "CONFIRMED: clear, never closer than 3.0 m, a and b at t = 4.5 s (limit 1.0 m)",
                "assumes  time: the column t is taken as s",
                "assumes  clocks: the times of all vehicles are of one clock",
                "assumes  vehicles: each name is one vehicle",
                "assumes  positions: x, y and z are in metres, in one frame and without errors",
                "assumes  motion: straight at constant speed between joined samples, which are up to 1 s apart",
                "assumes  gaps: samples of a vehicle are joined up to 1.5 s apart; longer gaps, not judged: 0",
                "assumes  presence: no vehicle is present before its first or after its last sample",
            ],
        )
        named = table("t_s,id,x,y,z")
        self.expect(CONFIRMED, named, proof_of(named), "time: the column t_s is in s\n")
        far = table(times=range(0, 100, 10))
        joined = "up to 10 s apart\nassumes  gaps: samples of a vehicle are joined up to 10.0 s apart, or always"
        self.expect(CONFIRMED, far, proof_of(far, max_gaps_s={"a": None, "b": 10.0}), joined)
        self.expect(CONFIRMED, far, proof_of(far, gap_s=None), "gaps: all samples of a vehicle are joined; ")
        different = proof_of(table(), max_gaps_s={"a": 1, "b": 2.5})
        self.expect(CONFIRMED, table(), different, "joined up to 1 s apart, by vehicle, and up to 2.5 s;")
        # No other vehicle is seen in the gap of c.
        alone = table() + "".join(f"{t},c,50,0,0\n" for t in (20, 21, 31, 32))
        out = self.expect(CONFIRMED, alone, proof_of(alone, "abc"), "; longer gaps, not judged: 1\n")
        self.assertIn("assumes  not judged, never present with another vehicle: c\n", out)
        # Neither vehicle is joined from 4 s to 14 s.
        gap = table(times=[0, 1, 2, 3, 4, 14, 15, 16, 17, 18])
        seen = {"smallest": math.sqrt(10), "status": "violation", "delta_m": 5.0}
        self.expect(CONFIRMED, gap, proof_of(gap, **seen), "; longer gaps, not judged: 2\n")
        self.expect(DENIED, gap, proof_of(gap, **seen | {"delta_m": 1.0, "status": "clear"}), "give undecided")
        velocities = table("t,id,x,y,z,vx,vy,vz,qw", "{t},{id},{x},{y},0,1,,nan,x")
        self.expect(CONFIRMED, velocities, proof_of(velocities), "assumes  columns that are not used: vx, vy, vz, qw\n")

    def test_a_moved_clock_is_accepted_by_the_caller_and_not_by_the_claim(self):
        moved = proof_of(table(), offsets_s={"a": 100.0, "b": 1e2})
        refusal = "the clock of vehicle a is moved by 100.0 s, which no data show; accept it with --offset NAME=SECONDS"
        self.expect(DENIED, table(), moved, refusal)
        self.expect(DENIED, table(), moved, "vehicle b is moved by 100.0 s", "--offset", "a=100")
        out = self.expect(CONFIRMED, table(), moved, "at t = 104.5 s", "--offset", "a=100", "--offset", "b=100.0")
        self.assertIn("assumes  clock of a, moved by 100.0 s\nassumes  clock of b, moved by 100.0 s\n", out)
        self.expect(DENIED, table(), moved, "vehicle a is moved by 100.0 s", "--offset", "a=99", "--offset", "b=100")
        self.expect(DENIED, table(), proof_of(table()), "vehicle a is moved by 0 s", "--offset", "a=1")
        for options in (["--offset"], ["--offset", "a=x"], ["--offset", "a"], ["third.json"]):
            self.assertEqual(run(moved, table(), *options)[0], UNREADABLE)

    def test_no_changed_fact_makes_a_collision_clear(self):
        """Each field of a proof is changed, and everything else computed again as the checker would accept it."""
        # Two vehicles meet at 5.4 s. Whole seconds, another unit or another start of the clock would move them apart.
        rows = [f"{1_700_000_000 + k}.4,a,{k},0,0" for k in range(11)]
        rows += [f"{1_700_000_000 + k}.6,b,5,{(10 * k - 48) / 10},0" for k in range(11)]
        rows += [f"{1_700_000_000 + k}.5,c,{k},50,0" for k in range(11)]
        text = "".join(f"{line}\n" for line in ("t,id,x,y,z", *rows))
        valid = proof_of(text, "abc", status="violation", smallest=0.0)
        self.expect(CONFIRMED, text, valid, "violation, never closer than 0.0 m, a and b at t = 1700000005.4 s")
        paths = [*nodes(valid), ("claim", "epoch_ns"), ("claim", "vehicles"), ("assumed", "clock"), ("windows",)]
        paths += [("assumed", "offsets_s", "a"), ("assumed", "max_gaps_s", "d")]
        changes = [(path, value) for path in paths for value in WRONG]
        for number in (None, 0, 1e-9, 0.99, 1, 1e70):
            changes.append((("assumed", "max_gaps_s"), {name: number for name in "abc"}))
            changes.append((("assumed", "offsets_s"), {name: number for name in "ab"}))
        seen = set()
        for path, value in changes:
            is_missing = value is MISSING and path not in nodes(valid)
            for forged in () if is_missing else reproved(changed(valid, path, value), text):
                code, out = run(forged, text)
                seen.add(code)
                self.assertFalse(code == CONFIRMED and "violation" not in out, f"{path} {value!r}: {out}")
        self.assertEqual(seen, {CONFIRMED, DENIED, UNREADABLE})
        # The start of the clock is no fact of a claim any more.
        old = {"format": "tautline proof", "version": 1, "data": valid["data"], "windows": []}
        old["claim"] = {"clock": {"unit": "s", "inferred": False, "epoch_ns": 8 * 10**24}}
        self.expect(UNREADABLE, text, old, "version 1 is not supported, 3 is; write the proof again with")

    def test_texts_of_numbers_are_exact_or_refused(self):
        text = table()
        valid = json.dumps(proof_of(text, max_gaps_s={"a": 1.25, "b": 1.25}))
        for number in ("3.0", "1.0", "1.25", "3"):
            for wrong in TEXTS:
                altered = valid.replace(f": {number}", f": {wrong}", 1)
                self.assertNotEqual(altered, valid)
                code, out = run(altered.encode(), text)
                # Any gap may be joined: the output states its length.
                is_gap = number == "1.25" and f"up to {wrong} s" in out
                self.assertTrue(code != CONFIRMED or is_gap, f"{wrong[:40]}: {out}")
        huge = valid.replace('"delta_m": 1.0', '"delta_m": 3.0000000000000000000000000000000001')
        self.expect(DENIED, text, huge.encode(), "give violation, not clear: never closer than 3.0 m, a and b at")
        even = huge.replace("01, ", "00, ").encode()
        self.expect(CONFIRMED, text, even, "(limit 3.0000000000000000000000000000000000 m)")
        twice = valid.replace('"status"', '"status": "violation", "status"')
        self.expect(UNREADABLE, text, twice.encode(), "proof: an object has a key twice")

    def test_decimals_decide_where_doubles_are_equal(self):
        """The written decimals are compared, not their doubles: 0.1 + 0.5 is the decimal 0.6, and is no violation."""
        for x, other, limit, status in (
            ("0.1", "0.6", 0.5, "clear"),
            ("0.1", "0.4", 0.3, "clear"),
            ("0.1", "0.59999999999999999999", 0.5, "violation"),
            ("1e-1", "+.6E0", 0.5, "clear"),
            ("0.1", "0.5" + "9" * 300, 0.5, "violation"),
            ("1234567890123456789", "1234567890123456790", 1, "clear"),
            ("1234567890123456789", "1234567890123456789.999", 1, "violation"),
        ):
            text = f"t,id,x,y,z\n0,a,{x},0,0\n0,b,{other},0,0\n1,a,{x},0,0\n1,b,{other},0,0\n"
            proof = proof_of(text, delta_m=limit, smallest=limit, status=status)
            self.expect(CONFIRMED, text, proof, status)
            proof["claim"]["status"] = "violation" if status == "clear" else "clear"
            self.expect(DENIED, text, proof, f"give {status}")

    def test_a_claim_that_no_rounding_explains_is_denied(self):
        for smallest in (0, 2.9, 2.9999999, 3.0000001, 4):
            self.expect(DENIED, table(), proof_of(table(), smallest=smallest), "the separation is not ")
        self.expect(CONFIRMED, table(), proof_of(table(), smallest=math.nextafter(3, 0)))
        text = table() + "0,c,50,0,0\n1,c,50,0,0\n"
        self.expect(CONFIRMED, text, proof_of(text, "abc"))
        self.expect(DENIED, text, proof_of(text, "abc", pair=["a", "c"]), "the pair of the claim does not come")
        self.expect(DENIED, text, proof_of(text, "abc", pair=["a", "d"]), "the pair of the claim is not in the data")

    def test_times_are_exact(self):
        """A time is never rounded: not by the size of a clock, by an exponent, or by a unit."""
        for times, unit in (
            ([f"17000000000000000000{t}.5" for t in range(10)], "s"),
            ([f"{t}e-30" for t in range(10)], "s"),
            ([f"1.700000000{t}e9" for t in range(10)], "s"),
            ([170_000_000_000_000_000_000 + t for t in range(10)], "ns"),
            ([f"-{9 - t}.25" for t in range(10)], "ms"),
        ):
            text = table(times=times)
            self.expect(CONFIRMED, text, proof_of(text, time_unit=unit, gap_s=None))

    def test_the_unit_of_the_table_is_that_of_the_claim(self):
        for header, code in (("t_s,id,x,y,z", DENIED), ("time_s,id,x,y,z", DENIED), ("time,id,x,y,z", CONFIRMED)):
            text = table(header)
            self.expect(code, text, proof_of(text, time_unit="ms"), "in s by the data" if code else "taken as ms")
            self.expect(CONFIRMED, text, proof_of(text))

    def test_dates_are_read_to_the_nanosecond(self):
        dates = [f"2023-01-01T00:00:0{t}Z" for t in range(10)]
        others = [f'"2023-01-01t0{t}:30:0{t},000000000+0{t}30"' for t in range(10)]
        for times in (dates, others, [*dates[:5], *others[5:]]):
            text = table(times=times)
            out = self.expect(CONFIRMED, text, proof_of(text, time_unit="ns"), "at 2023-01-01T00:00:04.500000000Z (")
            self.assertIn("time: the column of time holds dates\n", out)
            self.expect(DENIED, text, proof_of(text), "the times are in ns by the data")
        wrong_dates = ["2023-01-01T00:00:09", "2023-01-01T00:00:60Z", "2023-02-30T00:00:09Z", "9"]
        for wrong in (*wrong_dates, "2023-01-01T00:00:09+99:00"):
            text = table(times=[*dates[:9], wrong])
            self.expect(UNREADABLE, text, proof_of(text, time_unit="ns"), "data, line 11: ")

    def test_columns_that_may_change_the_reading_are_refused(self):
        names = ("name", "battery", "alt", "radius", "Radius1", "ref_lat", "T", "t_ns", "nsec", "time [ms]", "")
        names += ("stamp", "header.stamp.nanosec", "x [mm]", "icao24", "vehicle", "frame", "\u00b5s", "X", "vx1", "a.x")
        for name in names:
            text = table(f"t,id,x,y,z,{name}", "{t},{id},{x},{y},0,1")
            self.expect(UNREADABLE, text, proof_of(text), "could change the reading; audit a table without it")
        for header in ("t,id,x,y", "t,id,x,y,z,x", "t,id,x,y,z,time", "t,id,x,y,z,qw,qw", "id,x,y,z"):
            text = table(header, "{t},{id},{x},{y},0" + ",1" * (header.count(",") - 4))
            self.expect(UNREADABLE, text, proof_of(text), "data: must have the columns")
        for header in ("t;id;x;y;z", "t\tid\tx\ty\tz", "", "# t,id,x,y,z"):
            text = table(header)
            self.expect(UNREADABLE, text, proof_of(text), "data")

    def test_rows_that_may_be_read_in_a_second_way_are_refused(self):
        rows = ["10,a,,0,\n", ",a,,,\n", "10,,9,0,0\n", "10,a,,\n", "10,a,9,0,0,\n", "10,a,nan,0,0\n", "10,a,1_0,0,0\n"]
        rows += ["1e999,a,9,0,0\n", "10,a,0x1,0,0\n", "10,a,1e71,0,0\n", "10,a,\u0661,0,0\n", '9,"a\n",9,0,0\n']
        rows += ['10,"a"x,9,0,0\n', '10,a"b,9,0,0\n', '10, "a",9,0,0\n', '10,"a""b",9,0,0\n', "10,a,9 9,0,0\n"]
        rows += ["10,a,1e401,0,0\n", "10,a," + "1" * 401 + ",0,0\n", "# comment\n", "s,-,m,m,m\n"]
        for row in rows:
            self.expect(UNREADABLE, table() + row, proof_of(table() + row), "data, line 22: ")
        for row in ("9,b,0,3,0.1\n", "8,b,1,3,0\n"):
            self.expect(UNREADABLE, table() + row, proof_of(table() + row), "at two places at")
        for blank in "\t\x0b\x0c\r\x1c\x1f\x00\x7f\x85\xa0\u2003\u2028\u3000":
            text = table() + f"10,a{blank},9,0,0\n"
            self.expect(UNREADABLE, text, proof_of(text), "data, line 22: has a control character, or a blank")
        data = table().encode() + b"9,\xff,9,0,0\n"
        proof = proof_of("")
        proof["data"]["sha256"] = hashlib.sha256(data).hexdigest()
        self.expect(UNREADABLE, data, proof, "UnicodeDecodeError")
        same = [("cf1", "CF1"), ("cf1", "cf01"), ("cf-1", "cf_1"), ("1", "1.0"), ("1e1", "10"), ("a b", "ab")]
        for name, other in same:
            text = table(ids=(name, other))
            self.expect(UNREADABLE, text, proof_of(text, (name, other)), "could mean one vehicle")
        for name, other in (("cf1", "cf10"), ("1-2", "12"), ("a", "b"), ("1", "10")):
            text = table(ids=(name, other))
            self.expect(CONFIRMED, text, proof_of(text, (name, other)))

    def test_rows_are_read_as_tautline_reads_them(self):
        text = table()
        comments = "# t,id,x,y,z\n#\n" + text
        windows = text.replace("\n", "\r\n").replace("5,a", "\r\n  \r\n5,a")
        quoted = text.replace("t,id", '"t","id"').replace(",a,", ',"a",')
        spaced = text.replace(",", " , ")
        turned = "\n".join([text.splitlines()[0], *sorted(text.splitlines()[1:])]) + "\n"
        for other in (comments, windows, quoted, spaced, turned, "\ufeff" + text, text[:-1], text + "9,b,0.0,3e0,-0\n"):
            self.expect(CONFIRMED, other, proof_of(other))
        for name in ("b,c", "b\u00e9", "#b", "a b c", "b'"):
            other = table(ids=("a", f'"{name}"' if "," in name else name))
            called = f"a and {ascii(name) if name != '#b' else name} at"
            self.expect(CONFIRMED, other, proof_of(other, ("a", name)), called)
            self.expect(DENIED, other, proof_of(other, ("a", "b")), "is missing")
        unseen = text + "10,a,, ,\n10,c,,,\n"
        out = self.expect(CONFIRMED, unseen, proof_of(unseen, "abc"), "in which the vehicle is not seen: 2\n")
        self.assertIn("never present with another vehicle: c\n", out)
        self.expect(DENIED, unseen, proof_of(unseen), "c is missing")
        self.expect(DENIED, text, proof_of(text, "abc"), "c is missing")

    def test_a_malformed_proof_is_unreadable(self):
        valid = proof_of(table(), offsets_s={"a": 0.0})
        self.expect(CONFIRMED, table(), valid)
        self.assertTrue(is_true(valid))
        for path in nodes(valid):
            for value in WRONG:
                proof = changed(valid, path, value)
                code, out = run(proof, table())
                self.assertNotIn("Traceback", out)
                self.assertTrue(code != CONFIRMED or is_true(proof), f"{path} {value!r}: {out}")
        for path in [(), *(path for path in nodes(valid) if type(at(valid, path)) is dict)]:
            proof = changed(valid, (*path, "more"), 1.0) if path else valid | {"more": 1.0}
            self.assertNotEqual(run(proof, table())[0], CONFIRMED, path)
        for proof in (b"", b"[" * 100_000, b"null", b"[]", b'{"claim": []}', b"9" * 5000, b'"\\ud800"', b"\xff"):
            self.assertEqual(run(proof, table())[0], UNREADABLE)

    def test_damaged_files_exit_with_a_message(self):
        dice = random.Random(7)
        valid = proof_of(table(), offsets_s={"a": 0.0})
        for _ in range(1500):
            proof, data = bytearray(json.dumps(valid).encode()), bytearray(table().encode())
            damaged = dice.choice((proof, data))
            for _ in range(dice.randrange(1, 4)):
                damaged[dice.randrange(len(damaged))] = dice.choice(b"\x00\n\r\t \"'#,;-.0159aeENtz{}[]:\x85\xff")
            if damaged is data:
                other = copy.deepcopy(valid)
                other["data"]["sha256"] = hashlib.sha256(data).hexdigest()
                proof = json.dumps(other).encode()
            code, out = run(bytes(proof), bytes(data))
            self.assertRegex(out, "^(CONFIRMED|DENIED|UNREADABLE): ")
            is_right = code != CONFIRMED or damaged is data or is_true(json.loads(bytes(proof)))
            self.assertTrue(is_right, f"{proof!r}: {out}")

    def test_random_tables_are_judged_as_by_brute_force(self):
        dice = random.Random(11)
        verdicts = set()
        for _ in range(150):
            text, tracks, gap_s = random_table(dice)
            square, pair, is_hidden = brute_force(tracks, gap_s)
            names = list(tracks)
            if square is None:
                proof = proof_of(text, names, gap_s=gap_s, pair=names[:2], smallest=0)
                self.expect(DENIED, text, proof, "no two vehicles are present")
                continue
            least_m = math.sqrt(square)
            limit_m = least_m * dice.choice([0.5, 1 - 1e-12, 1 + 1e-12, 2]) or 0.5
            status = "violation" if square < Fraction(limit_m) ** 2 else "undecided" if is_hidden else "clear"
            claim = {"delta_m": limit_m, "smallest": least_m, "pair": pair}
            verdicts.add(status)
            for claimed in ("clear", "violation"):
                proof = proof_of(text, names, gap_s=gap_s, status=claimed, **claim)
                self.expect(CONFIRMED if claimed == status else DENIED, text, proof, status)
        self.assertEqual(verdicts, {"clear", "violation", "undecided"})

    def test_a_name_cannot_print_a_line_of_its_own(self):
        for name in ("\nCONFIRMED: clear", "\u2028CONFIRMED", "\x1b[2K"):
            for changes in ({"offsets_s": {name: "x"}}, {"offsets_s": {name: 1.0}}, {"pair": ["a", name]}, {}):
                code, out = run(proof_of(table(), ("a", name), **changes), table())
                self.assertNotEqual(code, CONFIRMED)
                self.assertEqual(len(out.splitlines()), 1, out)


def random_table(dice, sizes=(10, 10**6, 10**-6)):
    """A table of vehicles with steps and times of any kind, their samples as fractions, and the largest gap."""
    names = [f"v{k}" for k in range(dice.randrange(2, 6))]
    start, digits = dice.choice([0, 1_700_000_000, -50]), dice.choice([0, 1, 3, 20])
    size = dice.choice(sizes)
    tracks, rows = {}, []
    for name in names:
        time = Fraction(start) + Fraction(dice.randrange(0, 20), 10)
        for _ in range(dice.randrange(1, 12)):
            tenths = time.numerator * (10 // time.denominator)
            cells = [f"{tenths}e-1" if dice.random() < 0.2 else decimal_text(time, 1)]
            position = [round(Fraction(dice.uniform(-size, size)), digits) for _ in range(3)]
            cells += [name, *(decimal_text(x, digits) for x in position)]
            tracks.setdefault(name, []).append((time, position))
            rows.append((time, ",".join(cells)))
            time += Fraction(dice.choice([1, 5, 5, 5, 5, 30]), 10)
    if dice.random() < 0.5:
        rows.sort(key=lambda row: row[0])
    ends = dice.choice(["\n", "\r\n"])
    return ends.join(["t_s,id,x,y,z", *(row for _, row in rows), ""]), tracks, dice.choice([0.5, 1, None])


def decimal_text(number, digits):
    units = number * 10**digits
    whole, rest = divmod(abs(int(units)), 10**digits)
    return f"{'-' * (units < 0)}{whole}" + f".{rest:0{digits}}" * (digits > 0)


def brute_force(tracks, gap_s):
    """Smallest squared separation over all pairs of segments, a pair, and whether a gap may hide a violation."""
    best, pair, gaps, segments = None, None, [], {}
    for name, samples in tracks.items():
        segments[name] = [(samples[0], samples[0])]
        for before, after in zip(samples, samples[1:]):
            is_joined = gap_s is None or after[0] - before[0] <= Fraction(gap_s)
            segments[name].append((before, after) if is_joined else (after, after))
            gaps += [] if is_joined else [(name, before[0], after[0])]
    for k, first in enumerate(segments):
        for second in list(segments)[k + 1 :]:
            for a in segments[first]:
                for b in segments[second]:
                    begin, end = max(a[0][0], b[0][0]), min(a[1][0], b[1][0])
                    if begin > end:
                        continue
                    start, stop = (
                        [q - p for p, q in zip(place_on(a, time), place_on(b, time))] for time in (begin, end)
                    )
                    by = [y - x for x, y in zip(start, stop)]
                    speed = sum(x * x for x in by)
                    rate = sum(x * y for x, y in zip(start, by))
                    share = min(max(-rate / speed, Fraction(0)), Fraction(1)) if speed else Fraction(0)
                    square = sum((x + share * y) ** 2 for x, y in zip(start, by))
                    if best is None or square < best:
                        best, pair = square, [first, second]
    is_hidden = any(
        other != name and samples[0][0] < to and since < samples[-1][0]
        for name, since, to in gaps
        for other, samples in tracks.items()
    )
    return best, pair, is_hidden


def place_on(segment, time):
    (begin, start), (end, stop) = segment
    share = (time - begin) / (end - begin) if end > begin else Fraction(0)
    return [x + (y - x) * share for x, y in zip(start, stop)]


def with_limits(text, ids, *limits, status=None, **changes):
    """Proof of a table with these limits instead of a distance."""
    proof = proof_of(text, ids, **changes)
    is_violated = any(limit.get("status") == "violation" for limit in limits)
    claim = {"status": status or ("violation" if is_violated else "clear"), "limits": list(limits)}
    return proof | {"claim": proof["claim"] | claim}


def pair_limit(kind, status, smallest, pair=("a", "b"), above_m=None, **more):
    lengths = {"distance": {"delta_m": None, "radii_m": {}}, "ellipsoid": {"scaled": 2.0}, "cylinder": {}}[kind]
    common = {"kind": kind, "status": status, "smallest": smallest, "pair": list(pair), "above_m": above_m}
    return common | lengths | more


def vehicle_limit(kind, status, limit, extreme, vehicle="a"):
    return {"kind": kind, "status": status, "limit": limit, "extreme": extreme, "vehicle": vehicle}


def obstacles(status, smallest, *shapes, vehicle="a", obstacle="o"):
    limit = {"kind": "obstacles", "status": status, "smallest": smallest, "vehicle": vehicle, "obstacle": obstacle}
    return limit | {"obstacles": list(shapes)}


def shape(kind, name="o", at_m=(0, 0, 0), clearance_m=0.5, **lengths):
    return {"name": name, "at_m": list(at_m), "clearance_m": clearance_m, "shape": {"kind": kind} | lengths}


def fence(status, smallest, corners_m, margin_m=0.0, height_m=None, vehicle="a"):
    limit = {"kind": "fence", "status": status, "smallest": smallest, "vehicle": vehicle}
    return limit | {"corners_m": corners_m, "height_m": height_m, "margin_m": margin_m}


def way(*points, name="a"):
    """Rows of a vehicle with a point in each second."""
    return "".join(f"{t},{name},{x},{y},{z}\n" for t, (x, y, z) in enumerate(points))


def least_on_lines(tracks, function):
    """Smallest value of a convex function of the position, over the lines between samples, in doubles."""
    least = math.inf
    for samples in tracks:
        for (_, a), (_, b) in zip(samples, samples[1:] or samples):
            low, high = 0.0, 1.0

            def value(share, a=a, b=b):
                return function([float(x) + (float(y) - float(x)) * share for x, y in zip(a, b)])

            for _ in range(120):
                left, right = low + (high - low) / 3, high - (high - low) / 3
                low, high = (low, right) if value(left) < value(right) else (left, high)
            least = min(least, value(0.0), value(1.0), value(low))
    return least


HEADER = "t,id,x,y,z\n"
SQUARE = [[-10, -10], [10, -10], [10, 10], [-10, 10]]


class Limits(Case):
    def both(self, text, claimed, message, ids="ab", **wrong):
        """A limit is confirmed; with the other status, and with each of these wrong members, it is not."""
        self.expect(CONFIRMED, text, with_limits(text, ids, claimed, gap_s=None), message)
        other = {"clear": "violation", "violation": "clear"}[claimed["status"]]
        for key, value in [("status", other), *wrong.items()]:
            code, out = run(with_limits(text, ids, claimed | {key: value}, gap_s=None), text)
            self.assertNotEqual(code, CONFIRMED, f"{key} {value}: {out}")
            # Without a smallest distance, a fence is not clear.
            is_malformed = claimed.get("smallest", 0) is None and key == "status"
            self.assertEqual(code, UNREADABLE if is_malformed else DENIED, f"{key} {value}: {out}")

    def test_radii(self):
        """a and b pass each other 3 m apart, and c is 5 m from a."""
        text = table() + "".join(f"{t},c,{t},-5,0\n" for t in range(10))
        radii = {"a": 1.5, "b": 1.5, "c": 3.5}
        self.both(text, pair_limit("distance", "clear", 3.0, radii_m=radii), "(sum of the radii)", "abc", smallest=3.1)
        wide = pair_limit("distance", "violation", 3.0, radii_m=radii | {"c": 3.5000001}, delta_m=1.0)
        self.both(text, wide, "violation, never closer than 3.0 m, a and b", "abc", pair=["a", "c"], smallest=2.9)
        self.both(text, wide | {"radii_m": radii | {"c": 3.5}, "status": "clear"}, "radius of c: 3.5 m", "abc")
        for radii_m, message in (({"a": 1.0}, "has no radius"), (radii | {"d": 1.0}, "d has no radius")):
            proof = with_limits(text, "abc", pair_limit("distance", "clear", 3.0, radii_m=radii_m))
            self.expect(DENIED, text, proof, message)
        for lengths in ({}, {"delta_m": 0}, {"delta_m": "1"}, {"radii_m": {"a": -1, "b": 1, "c": 1}}, {"radii_m": []}):
            proof = with_limits(text, "abc", pair_limit("distance", "clear", 3.0, **lengths))
            self.expect(UNREADABLE, text, proof)

    def test_ellipsoids(self):
        """b is 0.75 m above a, twice a half axis of 0.375: the ellipsoids touch."""
        text = HEADER + way((0, 0, 0), (1, 0, 0)) + way((0, 0, 0.75), (1, 0, 0.75), name="b")
        axes = [0.125, 0.125, 0.375]
        touching = pair_limit("ellipsoid", "clear", 2.0, half_axes_m=axes)
        self.both(text, touching, "2.0 half axes, a and b at t = 0 s (limit 2.0, ellipsoids of 0.125", smallest=2.01)
        deeper = touching | {"status": "violation", "scaled": 2.0000001}
        self.both(text, deeper, "violation, never closer than 2.0 half axes", scaled=2.0)
        for axes_m in ([1, 1], [1, 1, 0], [1, 1, -1], [1, 1, "1"], 1):
            self.expect(UNREADABLE, text, with_limits(text, "ab", touching | {"half_axes_m": axes_m}))

    def test_cylinders(self):
        """b flies over a: 2 m above it, with the horizontal distance falling to 0 and rising again."""
        text = HEADER + way((0, 0, 0), (0, 0, 0)) + way((-8, 0, 2), (8, 0, 2), name="b")
        lengths = {"horizontal_m": 4.0, "vertical_m": 2.0}
        touching = pair_limit("cylinder", "clear", 1.0, **lengths)
        self.both(text, touching, "scaled distance at least 1.0 within", smallest=1.1)
        lower = {"horizontal_m": 4.0, "vertical_m": 2.0000001}
        self.both(text, pair_limit("cylinder", "violation", 2 / 2.0000001, **lower), "violation", vertical_m=2.0)
        # b climbs from 0 to 8 m while it comes from 8 m: at the share u, the larger of 8 - 8 u and 8 u.
        text = HEADER + way((0, 0, 0), (0, 0, 0)) + way((8, 0, 0), (0, 0, 8), name="b")
        self.both(text, pair_limit("cylinder", "clear", 1.0, horizontal_m=4.0, vertical_m=4.0), "")
        larger = pair_limit("cylinder", "violation", 4 / 4.000001, horizontal_m=4.000001, vertical_m=4.000001)
        self.both(text, larger, "violation", smallest=1.0)
        self.both(text, pair_limit("cylinder", "clear", 2.0, horizontal_m=2.0, vertical_m=2.0), "", smallest=1.9)

    def test_pairs_on_the_ground_are_not_judged(self):
        """Both vehicles climb from the ground 1 m apart, and are 3 m apart at the height of 1 m."""
        text = HEADER + way((0, 0, 0), (0, 0, 2)) + way((1, 0, 0), (5, 0, 2), name="b")
        limit = pair_limit("distance", "clear", 3.0, delta_m=3.0, above_m=1.0)
        message = "CONFIRMED: clear, never closer than 3.0 m, a and b at t = 0.5 s (limit 3.0 m)"
        self.both(text, limit, message, above_m=0.999, delta_m=3.0000001, smallest=3.1)
        self.both(text, limit | {"above_m": None, "smallest": 1.0, "status": "violation"}, "at t = 0 s", above_m=1.0)
        self.expect(DENIED, text, with_limits(text, "ab", limit | {"above_m": 2.0}), "at one time above the ground")
        # One vehicle in the air is enough.
        high = HEADER + way((0, 0, 0), (0, 0, 2)) + way((1, 0, 9), (5, 0, 9), name="b")
        # The relative position moves from (1, 0, 9) by (4, 0, -2): it is closest 0.7 on the way.
        one = pair_limit("distance", "clear", math.hypot(3.8, 7.6), delta_m=8.0, above_m=1.0)
        self.both(high, one, "ground: pairs are not judged while both vehicles are at or below the height of 1.0 m")
        scaled = pair_limit("ellipsoid", "clear", 1.5, half_axes_m=[2.0, 2.0, 4.0], scaled=1.5, above_m=1.0)
        self.both(text, scaled, "1.5 half axes, a and b at t = 0.5 s", above_m=0.99)
        flat = pair_limit("cylinder", "clear", 1.0, horizontal_m=3.0, vertical_m=4.0, above_m=1.0)
        self.both(text, flat, "", above_m=0.99)

    def test_obstacles_at_the_limit(self):
        """a flies along x at the height 2; each obstacle is at its limit, and a little more is a violation."""
        text = HEADER + way((-5, 0, 2), (5, 0, 2)) + way((-5, 90, 2), (5, 90, 2), name="b")
        for kind, lengths, at_m, smallest in (
            ("ball", {"radius_m": 1.0}, (0.25, 0, 0), 1.0),
            ("box", {"half_m": [1, 1, 0.5]}, (0, 0, 0), 1.5),
            ("box", {"half_m": [1, 1, 0.5]}, (6, 4, 5.5), math.sqrt(9 + 9)),
            ("capsule", {"from_m": [0, -3, -1], "to_m": [0, 3, -1], "radius_m": 0.5}, (0, 0, 1), 1.5),
            ("capsule", {"from_m": [0, 4, 1], "to_m": [3, 9, 5], "radius_m": 1.0}, (0, 0, 0), math.sqrt(17) - 1),
            ("capsule", {"from_m": [1, 3, 6], "to_m": [1, 3, 6], "radius_m": 1.0}, (0, 0, 0), 4.0),
            ("half-space", {"normal": [0, 3, 4]}, (0, 0, -1), 2.4),
        ):
            ground = shape(kind, at_m=at_m, clearance_m=smallest - 1e-6, **lengths)
            limit = obstacles("clear", smallest, ground)
            self.both(text, limit, "smallest distance of an obstacle", smallest=smallest - 1e-5, vehicle="b")
            near = {"status": "violation", "obstacles": [ground | {"clearance_m": smallest + 1e-6}]}
            self.both(text, limit | near, "")
            if smallest == int(2 * smallest) / 2:
                exact = obstacles("clear", smallest, ground | {"clearance_m": smallest})
                self.both(text, exact, f"clearance {smallest} m", obstacle="p")
        # Inside, the distance is negative. With the clearance 0 an obstacle may be touched.
        for kind, lengths, at_m, smallest in (
            ("ball", {"radius_m": 1.0}, (0, 0, 2), -1.0),
            ("box", {"half_m": [1, 2, 0.5]}, (0, 0, 2.25), -0.25),
            ("half-space", {"normal": [0, 0, 1]}, (0, 0, 3), -1.0),
        ):
            self.both(text, obstacles("violation", smallest, shape(kind, at_m=at_m, **lengths)), "", smallest=0.0)
        for kind, lengths, at_m in (
            ("ball", {"radius_m": 1.0}, (0, 0, 1)),
            ("box", {"half_m": [1, 1, 1]}, (0, 0, 1)),
            ("half-space", {"normal": [0, 0, 1]}, (0, 0, 2)),
        ):
            touched = shape(kind, at_m=at_m, clearance_m=0.0, **lengths)
            self.both(text, obstacles("clear", 0.0, touched), "", smallest=0.001)
            entered = shape(kind, at_m=(*at_m[:2], at_m[2] + 1e-6), clearance_m=0.0, **lengths)
            self.both(text, obstacles("violation", -1e-6, entered), "", smallest=0.0)
        both = [shape("ball", radius_m=1.0, at_m=(0, 0, -9)), shape("ball", "p", radius_m=1.0, at_m=(0, 90, 4))]
        nearest = obstacles("clear", 1.0, *both, vehicle="b", obstacle="p")
        out = self.expect(CONFIRMED, text, with_limits(text, "ab", nearest))
        self.assertIn("assumes  obstacle o: ball of radius 1.0 m at 0, 0, -9, clearance 0.5 m\n", out)
        self.expect(DENIED, text, with_limits(text, "ab", obstacles("clear", 10.0, *both)), "another pair comes closer")
        for wrong in (shape("ball", radius_m=0), shape("ball"), shape("box", half_m=[1, 1]), shape("cone"), 1):
            self.expect(UNREADABLE, text, with_limits(text, "ab", obstacles("clear", 1.0, wrong)))

    def test_speeds_and_heights_at_the_limit(self):
        """a flies 3 m along x, 4 m along y and climbs 12 m in a second, then sinks 6 m in half a second."""
        text = HEADER + way((0, 0, 0), (3, 4, 12)) + "1.5,a,3,4,6\n" + way((0, 50, 1), (1, 50, 1), name="b")
        for kind, value in (("speed", 13.0), ("horizontal", 5.0), ("climb", 12.0), ("descent", 12.0), ("height", 12.0)):
            limit = vehicle_limit(kind, "clear", value, value)
            self.both(text, limit, f"{kind} at most {value}, a (limit {value})", limit=value - 1e-9, vehicle="b")
            self.both(text, limit | {"limit": value - 1e-9, "status": "violation"}, "violation", extreme=value - 1e-3)
        floor = vehicle_limit("floor", "clear", 0.0, 0.0)
        self.both(text, floor, "floor at least 0.0, a (limit 0.0)", limit=1e-9, extreme=0.5, vehicle="b")
        self.both(text, floor | {"limit": 1e-9, "status": "violation"}, "violation", limit=-1e-9)
        # In milliseconds the speeds are a thousand times as large.
        fast = with_limits(text, "ab", vehicle_limit("speed", "clear", 13000, 13000), time_unit="ms", gap_s=None)
        self.expect(CONFIRMED, text, fast, "time: the column t is taken as ms")
        # Recorded velocities count, and a vehicle with one sample has a speed if it is recorded.
        header = "t,id,x,y,z,vx,vy,vz\n"
        recorded = header + "0,a,0,0,0,,,\n1,a,1,0,0,0,-7,0\n0,b,9,9,9,6,0,0\n"
        speed = vehicle_limit("speed", "clear", 7, 7)
        self.both(recorded, speed, "speed at most 7.0, a", limit=6.9)
        for cells, code, message in (
            (",,", DENIED, "give undecided"),
            ("6,,", UNREADABLE, "data, line 4: must be a finite decimal"),
            ("6,0,nan", UNREADABLE, "data, line 4: must be a finite decimal"),
        ):
            other = recorded.replace("6,0,0", cells)
            self.expect(code, other, with_limits(other, "ab", speed), message)
        some = recorded.replace(",vz", "").replace(",0\n", "\n").replace(",,\n", ",\n")
        self.expect(UNREADABLE, some, with_limits(some, "ab", speed), "each of the columns vx, vy and vz, or none")

    def test_fences_at_the_limit(self):
        """a flies from (-4, 0) to (8, 0), 2 m from the wall at x = 10."""
        text = HEADER + way((-4, 0, 1), (8, 0, 1)) + way((0, 0, 5), (0, 0, 5), name="b")
        inside = fence("clear", 2.0, SQUARE, 2.0)
        self.both(text, inside, "distance inside the fence 2.0 m", margin_m=2.000001, smallest=2.1, vehicle="b")
        self.both(text, fence("violation", 2.0, SQUARE, 2.000001), "violation", margin_m=2.0)
        self.both(text, fence("clear", 1.0, SQUARE, 1.0, [0, 6]), "heights from 0 to 6 m", height_m=[0.1, 6])
        # Along a wall is inside, and through a wall is not; a path touches a corner that points inwards.
        wall = [[-10, 0], [10, 0], [10, 10], [-10, 10]]
        self.both(text, fence("clear", 0.0, wall), "", smallest=0.1)
        self.both(text, fence("violation", None, wall, 0.1), "a is beyond the margin", vehicle="c")
        self.both(text, fence("violation", 0.0, wall, 0.1), "", margin_m=0.0)
        notch = [[-10, -10], [10, -10], [10, 10], [5, 10], [2, 0], [-1, 10], [-10, 10]]
        self.both(text, fence("clear", 0.0, notch), "", margin_m=0.001)
        deeper = [*notch[:4], [2, -1], *notch[5:]]
        self.both(text, fence("violation", None, deeper), "a is beyond", vehicle="b")
        out = [[-10, -10], [7, -10], [7, 10], [-10, 10]]
        self.both(text, fence("violation", None, out), "a is beyond the margin of the fence", vehicle="b")
        self.expect(DENIED, text, with_limits(text, "ab", fence("clear", 3.0, out)))
        unknown = with_limits(text, "ab", fence("clear", None, SQUARE))
        self.expect(UNREADABLE, text, unknown, "smallest must be a number")
        for corners in (SQUARE[:2], [1, 2, 3], [[1, 2], [3], [4, 5]], None):
            self.expect(UNREADABLE, text, with_limits(text, "ab", fence("clear", 1.0, corners)))

    def test_the_verdict_is_that_of_all_limits(self):
        text = table()
        slow = vehicle_limit("speed", "clear", 1, 1.0)
        fast = vehicle_limit("speed", "violation", 0.5, 1.0)
        apart = pair_limit("distance", "clear", 3.0, delta_m=1.0)
        kept = with_limits(text, "ab", apart, slow)
        out = self.expect(CONFIRMED, text, kept, "CONFIRMED: clear, all 2 limits kept\n")
        self.assertIn("limit    clear, never closer than 3.0 m, a and b at t = 4.5 s (limit 1.0 m)\n", out)
        self.assertIn("limit    clear, speed at most 1.0, a (limit 1)\n", out)
        out = self.expect(CONFIRMED, text, with_limits(text, "ab", apart, fast), "violation, 1 of 2 limits violated\n")
        self.assertIn("limit    violation, speed at most 1.0, a (limit 0.5)\n", out)
        for limits in ((apart, fast), (fast,)):
            self.expect(DENIED, text, with_limits(text, "ab", *limits, status="clear"), "give violation, not clear")
        self.expect(DENIED, text, with_limits(text, "ab", apart, slow, status="violation"), "give clear, not violation")
        for limits in ([], [apart] * 17, {}, [None], [{"kind": "accel"}], [{"kind": []}], [apart | {"more": 1}]):
            proof = with_limits(text, "ab", apart)
            self.expect(UNREADABLE, text, changed(proof, ("claim", "limits"), limits))
        # A gap hides a speed, and the distance from an obstacle, of a vehicle that is alone.
        alone = table() + "".join(f"{t},c,{t},70,0\n" for t in (20, 21, 31, 32))
        for limit in (slow, obstacles("clear", 9.0, shape("half-space", at_m=(0, 0, -9), normal=[0, 0, 1]))):
            self.expect(DENIED, alone, with_limits(alone, "abc", limit), "give undecided")
            self.expect(CONFIRMED, alone, with_limits(alone, "abc", limit, gap_s=10), "longer gaps, not judged: 0")

    def test_random_limits_are_judged_as_by_search(self):
        """Each limit is convex on a line: a search in doubles finds its smallest value."""
        dice = random.Random(5)
        for _ in range(12):
            text, tracks, _ = random_table(dice, sizes=[10])
            names, size = list(tracks), 10
            center = [round(dice.uniform(-size, size), 2) for _ in range(3)]
            half = [round(dice.uniform(0.5, 4), 2) for _ in range(3)]
            ends = [[round(dice.uniform(-5, 5), 2) for _ in range(3)] for _ in range(2)]
            corner = round(dice.uniform(4, 25), 2)
            square = [[x * corner / 10, y * corner / 10] for x, y in SQUARE]
            cases = {
                "ball": (shape("ball", at_m=center, radius_m=half[0]), lambda p: math.dist(p, center) - half[0]),
                "box": (shape("box", at_m=center, half_m=half), lambda p: from_box(p, center, half)),
                "capsule": (
                    shape("capsule", at_m=center, from_m=ends[0], to_m=ends[1], radius_m=half[0]),
                    lambda p: from_line([x - c for x, c in zip(p, center)], *ends) - half[0],
                ),
                "half-space": (shape("half-space", at_m=center, normal=half), lambda p: from_plane(p, center, half)),
            }
            for judged, function in cases.values():
                of_vehicle = {name: least_on_lines([tracks[name]], function) for name in names}
                vehicle = min(of_vehicle, key=of_vehicle.get)
                least = of_vehicle[vehicle]
                limit = obstacles("clear", least, judged, vehicle=vehicle)
                for clearance_m in (0.0, max(least * 0.999, 0.0), max(least, 0.0) + 1e-6, 7.0):
                    status = "clear" if least >= clearance_m or abs(least) < 1e-12 and not clearance_m else "violation"
                    limit = limit | {"status": status, "obstacles": [judged | {"clearance_m": clearance_m}]}
                    self.both(text, limit, "", names, smallest=least + 1e-6)
            inside = min(
                least_on_lines(tracks.values(), lambda p, side=side, axis=axis: corner - side * p[axis])
                for side in (-1, 1)
                for axis in (0, 1)
            )
            nearest = min(
                (min(corner - abs(float(x)) for _, place in tracks[name] for x in place[:2]), name) for name in names
            )
            status = "clear" if inside >= 0 else "violation"
            limit = fence(status, inside if inside >= 0 else None, square, vehicle=nearest[1])
            self.both(text, limit, "", names, **({"smallest": inside + 1e-6} if inside >= 0 else {}))

    def test_the_effort_is_bounded(self):
        """A proof of another author cannot keep the program busy for ever."""
        text = "t,id,x,y,z\n" + "".join(f"0,v{k},{k},0,0\n1,v{k},{k},0,0\n" for k in range(60))
        names = [f"v{k}" for k in range(60)]
        apart = pair_limit("distance", "clear", 1.0, ("v0", "v1"), delta_m=1.0)
        proof = with_limits(text, names, apart)
        self.expect(CONFIRMED, text, proof)
        self.expect(DENIED, text, proof, "not decided by 10 comparisons; allow more with --effort", "--effort", "10")
        self.expect(CONFIRMED, text, proof, "", "--effort", "100000")
        many = [shape("ball", f"o{k}", (0, 9, k), radius_m=1.0) for k in range(2000)]
        limit = obstacles("clear", 8.0, *many, vehicle="v0", obstacle="o0")
        self.expect(DENIED, text, with_limits(text, names, limit), "not decided by", "--effort", "100000")
        large = [[10 * x, 10 * y] for x, y in SQUARE]
        wide = fence("clear", 41.0, [*large, *([-100, 100 - k / 1000] for k in range(1, 2000))], vehicle="v59")
        self.expect(CONFIRMED, text, with_limits(text, names, wide))
        self.expect(DENIED, text, with_limits(text, names, wide), "not decided by", "--effort", "10000")
        # A path along the teeth of a wall meets all of them, and each part asks all edges.
        teeth = [[k, -(k % 2) * 1e-9] for k in range(-200, 201)] + [[200, 90], [-200, 90]]
        along = "t,id,x,y,z\n" + way((-199, 0, 0), (199, 0, 0))
        comb = with_limits(along, "a", fence("clear", 0.0, teeth))
        self.expect(DENIED, along, comb, "not decided by", "--effort", "50000")
        for words in (["--effort", "x"], ["--effort"]):
            self.assertEqual(run(proof, text, *words)[0], UNREADABLE)


def curve(*pieces, degree=7, axes=("x", "y", "z", "yaw")):
    """File of a trajectory: duration, and the coefficients of each axis, the constant first."""
    lines = [",".join(["duration", *(f"{axis}^{k}" for axis in axes for k in range(degree + 1))])]
    for duration, *coefficients in pieces:
        cells = [duration]
        for axis in [*coefficients, [], [], [], []][: len(axes)]:
            cells += [*axis, *[0] * (degree + 1 - len(axis))]
        lines.append(",".join(map(str, cells)))
    return "".join(f"{line}\n" for line in lines)


def proof_of_curves(files, limit, form="crazyflie"):
    """Proof of curves by vehicle."""
    hashes = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in files.items()}
    return {
        "format": "tautline proof",
        "version": 3,
        "data": {"format": form, "recording": "folder", "sha256": hashes},
        "claim": {"status": limit["status"], "motion": "polynomial", "limits": [limit]},
        "assumed": {"time_unit": "s", "max_gaps_s": {}, "offsets_s": {}},
    }


def place_of(pieces, time):
    for duration, *axes in pieces:
        if time <= duration:
            return [sum(c * time**k for k, c in enumerate(axis)) for axis in axes]
        time -= duration


class CurveCase(Case):
    # b passes a, which stands at the origin, at a distance of 3 m after 1 s, on a parabola.
    FILES = {"a": curve((4, [0])), "b": curve((1.5, [-1, 1], [3], [1, -2, 1]), (2.5, [0.5, 1], [3], [0.25, 1, 1]))}
    LIMIT = pair_limit("distance", "clear", 3.0, delta_m=3.0)

    def both(self, files, claimed, message, form="crazyflie", **wrong):
        """A limit is confirmed; with the other status, and with each of these wrong members, it is denied."""
        texts = list(files.values())[::-1]
        out = self.expect(CONFIRMED, texts, proof_of_curves(files, claimed, form), message)
        other = {"clear": "violation", "violation": "clear"}[claimed["status"]]
        for key, value in [("status", other), *wrong.items()]:
            self.expect(DENIED, texts, proof_of_curves(files, claimed | {key: value}, form))
        return out

    def test_curves_at_the_limit(self):
        out = self.both(self.FILES, self.LIMIT, "CONFIRMED: clear, never closer than 2.99999", smallest=3.001)
        self.assertRegex(out, r"m, a and b within \S+e-8 m of this at t = \S+ s \(limit 3.0 m\)\n")
        self.assertIn("assumes  vehicle b: the file with the SHA-256 ", out)
        self.assertIn("assumes  jumps: 0 between pieces, up to 0.0 m", out)
        self.both(self.FILES, self.LIMIT | {"status": "violation", "delta_m": 3.0000001}, "violation", smallest=2.999)
        self.both(self.FILES, self.LIMIT | {"delta_m": 1.0}, "", delta_m=3.1, smallest=2.9999)
        radii = {"a": 1.25, "b": 1.75}
        self.both(self.FILES, self.LIMIT | {"delta_m": None, "radii_m": radii}, "radius of b: 1.75 m")
        # In half axes of 1, 1.5 and 2 m the pair is 2 apart.
        axes = pair_limit("ellipsoid", "clear", 2.0, half_axes_m=[1.0, 1.5, 2.0])
        self.both(self.FILES, axes, "half axes, a and b within", half_axes_m=[1.0, 1.51, 2.0], smallest=2.1)
        self.both(self.FILES, axes | {"status": "violation", "scaled": 2.0000001}, "", scaled=2.0)

    def test_a_distance_that_only_touches_its_limit_is_decided_or_denied(self):
        """The distance is 5 m at a third of a piece, which no halving reaches."""
        files = {"a": curve((3, [0]), degree=1), "b": curve((3, [-1, 4], [7, -3]), degree=1)}
        limit = self.LIMIT | {"smallest": 5.0, "delta_m": 5.0}
        message = "so near to a limit that it is not decided"
        self.expect(DENIED, [*files.values()], proof_of_curves(files, limit), message)
        self.both(files, limit | {"delta_m": 4.999999999}, "")

    def test_curves_of_bezier(self):
        """The same motion by control points."""
        header = "duration,p0x,p0y,p0z,p1x,p1y,p1z,p2x,p2y,p2z\n"
        files = {"a": header + "4" + ",0" * 9 + "\n", "b": header + "2,-1,3,1,0,3,-1,1,3,1\n"}
        self.both(files, self.LIMIT, "", "bezier", smallest=3.001)
        wrong_files = ["duration,p0x,p0y\n1,0,0\n", "duration,p0x,p0y,...\n", header, header + "2,1\n"]
        for wrong in (*wrong_files, "#" + files["b"]):
            altered = files | {"b": wrong}
            self.expect(UNREADABLE, [*altered.values()], proof_of_curves(altered, self.LIMIT, "bezier"))

    def test_jumps_are_straight(self):
        """b jumps past a at 1 s: 4 m apart before and after, 1 m in between."""
        far = math.sqrt(16 + 1)
        files = {"a": curve((2, [0])), "b": curve((1, [-4], [1]), (1, [4], [1]))}
        self.both(files, self.LIMIT | {"smallest": 1.0, "status": "violation"}, "at t = 1 s", smallest=far)

    def test_jumps_of_both_vehicles_at_once_meet_only_each_other(self):
        """a and b jump by 10 m together, 1.5 m apart; then through each other."""
        files = {"a": curve((1, [0]), (1, [10])), "b": curve((1, [1.5]), (1, [11.5]))}
        self.both(files, self.LIMIT | {"smallest": 1.5, "delta_m": 1.0}, "", smallest=0.0)
        forged = self.LIMIT | {"status": "violation", "smallest": 0.0, "delta_m": 1.0}
        self.expect(DENIED, [*files.values()], proof_of_curves(files, forged))
        # They swap places: halfway they meet.
        files["b"] = curve((1, [10]), (1, [0]))
        self.both(files, self.LIMIT | {"status": "violation", "smallest": 0.0, "delta_m": 1.0}, "", smallest=1.0)

    def test_each_file_is_that_of_its_vehicle(self):
        proof = proof_of_curves(self.FILES, self.LIMIT)
        texts = [*self.FILES.values()]
        self.expect(DENIED, [texts[0], texts[1] + " "], proof, "the data of vehicle b is not that of the proof")
        self.expect(DENIED, texts[:1], proof, "the data of vehicle b is not that of the proof")
        self.expect(DENIED, [*texts, curve((1, [9]))], proof, "the proof is about 2 files")
        for path, value, code in (
            (("assumed", "time_unit"), "ms", DENIED),
            (("assumed", "max_gaps_s"), {"a": 1}, DENIED),
            (("assumed", "offsets_s"), {"a": 1}, DENIED),
            (("claim", "motion"), "linear", UNREADABLE),
            (("data", "format"), "csv", UNREADABLE),
            (("data", "sha256"), "0", UNREADABLE),
            (("data", "sha256"), {"a": 1}, UNREADABLE),
            (("claim", "limits"), [self.LIMIT | {"above_m": 1}], UNREADABLE),
            (("claim", "limits"), [vehicle_limit("speed", "clear", 9, 1)], UNREADABLE),
        ):
            self.expect(code, texts, changed(proof, path, value))
        self.expect(DENIED, texts, proof, "", "--offset", "a=1")
        for form in ("csv", "run"):
            straight = changed(proof_of(texts[0]), ("data", "format"), "bezier" if form == "csv" else form)
            self.expect(UNREADABLE, texts[0], straight)

    def test_rows_that_may_be_read_in_a_second_way_are_refused(self):
        good = self.FILES["b"]
        header, first, _ = good.splitlines()
        wrong = ["", header + "\n", f"{header}\n0{first[3:]}\n", f"{header}\n-{first}\n", good + "1,2\n"]
        wrong.append(good + "# end\n")
        wrong += [good.replace("x^7", "x^8"), good.replace("yaw^7", "w^7"), good.replace("x^7", "x^6"), "t," + good]
        wrong += [good.replace(",3,", ",nan,", 1), good.replace(",3,", ",1e71,", 1), good.replace(",3,", ",,", 1)]
        wrong += [curve((1, [0]), degree=16), curve((1, [0]), axes=("x", "y")), good.replace(",", ";")]
        for text in wrong:
            files = self.FILES | {"b": text}
            self.expect(UNREADABLE, [*files.values()], proof_of_curves(files, self.LIMIT), "data of b")
        lower = curve((1.5, [-1, 1], [3], [1, -2, 1]), degree=3, axes="xyz")
        for text in (good.replace("duration", "Duration"), lower):
            files = self.FILES | {"b": text}
            self.expect(CONFIRMED, [*files.values()], proof_of_curves(files, self.LIMIT))

    def test_random_curves_are_judged_as_by_search(self):
        dice = random.Random(3)
        for _ in range(12):
            degree, names, curves = dice.choice([1, 3, 7]), [f"v{k}" for k in range(dice.randrange(2, 4))], {}
            for name in names:
                curves[name] = []
                for _ in range(dice.randrange(1, 4)):
                    duration = round(dice.uniform(0.5, 2), 3)
                    axes = [[round(dice.uniform(-5, 5) / duration**k, 4) for k in range(degree + 1)] for _ in range(3)]
                    if curves[name]:
                        # The pieces meet.
                        before = curves[name][-1]
                        for axis, end in zip(axes, place_of([before], before[0])):
                            axis[0] = end
                    curves[name].append((duration, *axes))
            best, pair = math.inf, None
            for k, first in enumerate(names):
                for second in names[k + 1 :]:
                    end = min(sum(piece[0] for piece in curves[name]) for name in (first, second))

                    def distance(time, first=first, second=second):
                        return math.dist(place_of(curves[first], time), place_of(curves[second], time))

                    # Between two of many samples, the distance has one minimum.
                    times = [end * j / 2000 for j in range(2000)]
                    near = min(times, key=distance)
                    low, high = max(near - end / 2000, 0), min(near + end / 2000, end * (1 - 1e-15))
                    for _ in range(100):
                        left, right = low + (high - low) / 3, high - (high - low) / 3
                        low, high = (low, right) if distance(left) < distance(right) else (left, high)
                    if min(distance(low), distance(0)) < best:
                        best, pair = min(distance(low), distance(0)), [first, second]
            files = {name: curve(*pieces, degree=degree) for name, pieces in curves.items()}
            limit = pair_limit("distance", "clear", best, pair, delta_m=best * 0.999)
            self.both(files, limit, "", smallest=best * 1.001, delta_m=best * 1.001)
            self.both(files, limit | {"delta_m": best * 1.001, "status": "violation"}, "", smallest=best * 0.999)

    def test_the_effort_is_bounded(self):
        """Curves that stay at their limit need parts without end."""
        # The relative position turns: sine and cosine to the seventh power leave the distance within 1e-6 of 1 m.
        sine = [0, 1, 0, -1 / 6, 0, 1 / 120, 0, -1 / 5040]
        cosine = [1, 0, -1 / 2, 0, 1 / 24, 0, -1 / 720, 0]
        files = {"a": curve((1, [0])), "b": curve((1, [f"{x:.20f}" for x in sine], [f"{x:.20f}" for x in cosine]))}
        limit = self.LIMIT | {"smallest": 0.99999, "delta_m": 0.9}
        texts = [*files.values()]
        self.expect(DENIED, texts, proof_of_curves(files, limit), "", "--effort", "10")
        started = time.monotonic()
        for smallest in (0.9999752, 0.99997, 1.0):
            run(proof_of_curves(files, limit | {"smallest": smallest}), texts)
        # Long numbers, and many pieces.
        for digits, code, message in ((390, UNREADABLE, "at most 70 digits"), (70, DENIED, "not decided by")):
            long = f"0.{'7' * digits}"
            slow = self.FILES | {"b": curve(*[(long, *[[long] * 16] * 3)] * 3000, degree=15)}
            self.expect(code, [*slow.values()], proof_of_curves(slow, self.LIMIT), message, "--effort", "200000")
        self.assertLess(time.monotonic() - started, 120)


def record(kind, *parts):
    body = b"".join(parts)
    return bytes([kind]) + len(body).to_bytes(8, "little") + body


def string(text):
    return len(text).to_bytes(4, "little") + text.encode()


def swarm(time_s, step, positions, velocities=None):
    """Message of /swarm in CDR."""
    body = struct.pack("<dQ", time_s, step)
    for numbers in (positions, [0.0] * len(positions) if velocities is None else velocities, []):
        body += b"\0" * (-len(body) % 4) + len(numbers).to_bytes(4, "little")
        body += b"\0" * (-len(body) % 8) + struct.pack(f"<{len(numbers)}d", *numbers)
    return b"\0\1\0\0" + body


def run_file(
    messages, schema="tautline_msgs/msg/Swarm", topics=("/scenario", "/swarm"), compression="", is_chunked=True
):
    """A `run.mcap`, with a chunk for each message or without chunks."""
    content = record(3, b"\7\0", string(schema), string("ros2msg"), string("# fields"))
    for channel, topic in enumerate(topics):
        content += record(4, bytes([channel, 0, 7, 0]), string(topic), string("cdr"), string(""))
    chunks = b"".join(
        record(6, bytes(28), string(compression), len(one).to_bytes(8, "little"), one) if is_chunked else one
        for one in (content, *(record(5, b"\1\0", bytes(20), message) for message in messages))
    )
    return b"\x89MCAP0\r\n" + record(1, string(""), string("test")) + chunks + record(15, bytes(4)) + (
        record(2, bytes(20)) + b"\x89MCAP0\r\n"
    )


class RunCase(Case):
    # Two vehicles that pass each other 3 m apart at 0.5 s.
    MESSAGES = [swarm(0.25 * k, k, [k - 2.0, 0, 0, 2.0 - k, 3, 0], [4.0, 0, 0, -4.0, 0, 3]) for k in range(5)]

    def proof(self, data, *limits):
        apart = pair_limit("distance", "clear", 3.0, "12", delta_m=1.0)
        proof = with_limits("", "12", *(limits or [apart]), gap_s=None)
        return proof | {"data": {"format": "run", "recording": "r", "sha256": hashlib.sha256(data).hexdigest()}}

    def test_samples_are_doubles_without_rounding(self):
        data = run_file(self.MESSAGES)
        out = self.expect(CONFIRMED, data, self.proof(data), "clear, never closer than 3.0 m, 1 and 2 at t = 0.5 s")
        self.assertIn("assumes  time: the time of a sample is in s\n", out)
        self.assertIn("assumes  samples: 5 samples, of successive steps of the run\n", out)
        coarse = run_file(self.MESSAGES[::2])
        self.expect(CONFIRMED, coarse, self.proof(coarse), "samples: 3 samples, not of each step\n")
        # Recorded velocities count: 5 m/s of vehicle 2.
        for limit, status, code in ((5, "clear", CONFIRMED), (4.9, "clear", DENIED), (4.9, "violation", CONFIRMED)):
            speed = vehicle_limit("speed", status, limit, 5.0, "2")
            self.expect(code, data, self.proof(data, speed))
        # The doubles nearest to 0.1 and 0.6 are less than 0.5 apart.
        near = run_file([swarm(float(k), k, [0.1, 0, 0, 0.6, 0, 0]) for k in (0, 1)])
        half = pair_limit("distance", "violation", math.nextafter(0.5, 0), "12", delta_m=0.5)
        self.expect(CONFIRMED, near, self.proof(near, half), "never closer than 0.49999999999999994 m")
        self.expect(DENIED, near, self.proof(near, half | {"status": "clear"}), "give violation, not clear")

    def test_malformed_recordings_are_unreadable(self):
        valid = run_file(self.MESSAGES)
        odd = [swarm(0.0, 0, [0.0] * 5), swarm(0.0, 0, [0.0] * 6, [0.0] * 3), swarm(math.nan, 0, [0.0] * 6)]
        odd += [swarm(0.0, 0, [0.0] * 5 + [math.inf]), swarm(0.0, 0, [0.0] * 5 + [1e71]), swarm(0.0, 0, [0.0] * 9)]
        odd += [b"\0\0" + self.MESSAGES[0][2:], self.MESSAGES[0][:-40], b"", swarm(0.75, 3, [0.0] * 6)]
        for data in (
            *(run_file([*self.MESSAGES, message]) for message in odd),
            run_file(self.MESSAGES, schema="other/msg/Swarm"),
            run_file(self.MESSAGES, topics=("/a", "/swarm", "/swarm")),
            run_file(self.MESSAGES, topics=("/swarms", "/a")),
            run_file(self.MESSAGES, compression="lz4"),
            run_file([]),
            # A record after the first footer, and a footer within a chunk, hide samples from some readers.
            valid[:-37] + record(2, bytes(20)) + valid[-37:],
            run_file([*self.MESSAGES[:2], b"", *self.MESSAGES[2:]]).replace(
                record(5, b"\1\0", bytes(20)), record(2, bytes(20 + 2))
            ),
            valid.replace(string("cdr"), string("cdx")),
            valid.replace(string("ros2msg"), string("ros1msg")),
            valid[:-8],
            valid[8:],
            valid + b"\0",
            valid[:100] + valid[101:],
            table().encode(),
            b"",
        ):
            self.expect(UNREADABLE, data, self.proof(data))
        # Without chunks, the schema counts too.
        for schema, code in (("tautline_msgs/msg/Swarm", CONFIRMED), ("other/msg/Swarm", UNREADABLE)):
            flat = run_file(self.MESSAGES, schema, is_chunked=False)
            self.expect(code, flat, self.proof(flat))
        dice = random.Random(2)
        for _ in range(300):
            damaged = bytearray(valid)
            damaged[dice.randrange(len(damaged))] = dice.randrange(256)
            code, out = run(self.proof(bytes(damaged)), bytes(damaged))
            self.assertRegex(out, "^(CONFIRMED|DENIED|UNREADABLE): ")

    def test_numbers_of_any_size_are_exact(self):
        """Doubles from 1e-300 to 1e60 in one recording."""
        for x in (1e-300, 5e-323, 1e60):
            data = run_file([swarm(float(k), k, [0.0, 0, 0, x, 0, 0]) for k in range(3)])
            limit = pair_limit("distance", "clear", x, "12", delta_m=x / 2)
            self.expect(CONFIRMED, data, self.proof(data, limit), f"never closer than {x!r} m")


def from_box(place, center, half):
    gaps = [abs(x - c) - h for x, c, h in zip(place, center, half)]
    return math.hypot(*(max(gap, 0) for gap in gaps)) if max(gaps) > 0 else max(gaps)


def from_line(place, start, end):
    by = [y - x for x, y in zip(start, end)]
    share = sum((p - x) * d for p, x, d in zip(place, start, by)) / (sum(d * d for d in by) or 1)
    return math.dist(place, [x + d * min(max(share, 0), 1) for x, d in zip(start, by)])


def from_plane(place, center, normal):
    return sum(n * (x - c) for n, x, c in zip(normal, place, center)) / math.hypot(*normal)


def alterations(proof):
    """Yields a description of an alteration, and the altered proof."""
    claim = proof["claim"]
    other_status = {"clear": "violation", "violation": "clear"}
    yield "status", changed(proof, ("claim", "status"), other_status[claim["status"]])
    yield "no limit", changed(proof, ("claim", "limits"), [])
    for k, limit in enumerate(claim["limits"]):
        place = ("claim", "limits", k)
        flipped = changed(proof, (*place, "status"), other_status[limit["status"]])
        yield f"status of limit {k}", flipped
        statuses = {other["status"] for other in flipped["claim"]["limits"]}
        yield f"both statuses, {k}", changed(flipped, ("claim", "status"), max(statuses))
        extreme = "extreme" if "extreme" in limit else "smallest"
        if abs(limit[extreme] or 0) > 1e-3:
            for factor in (0.9999, 1.0001):
                yield f"{extreme} {factor}", changed(proof, (*place, extreme), limit[extreme] * factor)
            # A floor, a fence and a distance are least values.
            is_least = limit["kind"] not in ("speed", "horizontal", "climb", "descent", "height")
            wider = (limit["status"] == "clear") == is_least
            far = limit[extreme] + abs(limit[extreme]) * (0.001 if wider else -0.001)
            for key in ("delta_m", "limit", "margin_m", "scaled"):
                if limit.get(key) and not limit.get("radii_m"):
                    yield f"{key} of limit {k}", changed(proof, (*place, key), far)
        for key in limit.keys() & {"pair", "vehicle"}:
            yield f"{key} of limit {k}", changed(proof, (*place, key), ["x", "y"] if key == "pair" else "x")
    for vehicle in list(proof["assumed"]["max_gaps_s"])[:1]:
        yield "vehicle", changed(proof, ("assumed", "max_gaps_s", vehicle), MISSING)
        yield "clock", changed(proof, ("assumed", "offsets_s", vehicle), 1e9)
    hashes = proof["data"]["sha256"]
    wrong = "0" * 64 if type(hashes) is str else {name: "0" * 64 for name in hashes}
    yield "hash", changed(proof, ("data", "sha256"), wrong)


def data_of(path):
    """Files of the proof NAME.json: NAME.csv, or those of the folder NAME."""
    folder = path.with_suffix("")
    return [file.read_bytes() for file in (folder.iterdir() if folder.is_dir() else [path.with_suffix(".csv")])]


def main():
    if not unittest.main(argv=["proofs"], exit=False).result.wasSuccessful():
        sys.exit("the checker fails")
    confirmed = altered = refused = 0
    kinds = set()
    for path in sorted(Path(FOLDER).glob("*.json")):
        proof, data = json.loads(path.read_text()), data_of(path)
        offsets = [f"--offset={name}={by_s}" for name, by_s in proof["assumed"]["offsets_s"].items()]
        code, out = run(proof, data, *(word for option in offsets for word in option.split("=", 1)))
        if path.with_suffix(".refused").exists():
            refused += code == UNREADABLE
            continue
        if code != CONFIRMED:
            sys.exit(f"{path}: {out}")
        confirmed += 1
        kinds |= {f"{limit['kind']} {limit['status']}" for limit in proof["claim"]["limits"]}
        for what, other in alterations(proof):
            if run(other, data)[0] == CONFIRMED:
                sys.exit(f"{path}: not denied: {what}")
            altered += 1
        if run(proof, [*data[:-1], data[-1] + b"\n"])[0] != DENIED:
            sys.exit(f"{path}: not denied: other data")
    print(f"{confirmed} confirmed, {refused} refused, {altered} altered and denied; {', '.join(sorted(kinds))}")


main()
