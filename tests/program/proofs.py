"""Tests of the checker of proofs.

Usage: `python3 proofs.py check_proof.py FOLDER`, where FOLDER holds NAME.csv and NAME.json. Each proof of the folder is
confirmed, or refused where NAME.json is followed by NAME.refused; it is denied after each alteration. The tests of
`Checker` write proofs of their own.
"""

import contextlib
import copy
import hashlib
import importlib.util
import io
import json
import math
import random
import sys
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
        "version": 2,
        "data": {"format": "csv", "recording": "data.csv", "sha256": hashlib.sha256(text.encode()).hexdigest()},
        "claim": {
            "status": "clear",
            "motion": "linear",
            "limit": {"kind": "distance", "distance_m": 1.0},
            "separation_m": 3.0,
            "pair": list(ids[:2]),
        },
        "assumed": {"time_unit": "s", "max_gaps_s": {name: gap_s for name in ids}, "offsets_s": {}},
    }
    for part in (proof["claim"]["limit"], proof["claim"], proof["assumed"]):
        part |= {key: changes[key] for key in part.keys() & changes.keys()}
    return proof


def run(proof, data, *options):
    """Returns the exit code and the output of the checker. `proof` is JSON, or the bytes of a file."""
    files = {
        "proof.json": proof if type(proof) is bytes else json.dumps(proof).encode(),
        "data.csv": data if type(data) is bytes else data.encode(),
    }
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
    for pair in (["a", "b"], ["a", "c"]):
        for status in ("clear", "violation", "undecided"):
            other = proof | {"claim": claim | {"pair": pair, "status": status}}
            yield other
            # The checker denies with the separation that it computes.
            found = run(other, text)[1].partition("never closer than ")[2].split(" ")[0]
            if found:
                yield other | {"claim": other["claim"] | {"separation_m": float(found)}}


def is_true(proof):
    """Whether the claim of a proof of `table()` is true."""
    claim, assumed = proof["claim"], proof["assumed"]
    is_kept = claim["separation_m"] == 3 or abs(claim["separation_m"] - 3) < 1e-8
    is_kept &= sorted(claim["pair"]) == ["a", "b"] and claim["motion"] == "linear"
    is_kept &= all(by_s == 0 for by_s in assumed["offsets_s"].values())
    limit_m = claim["limit"]["distance_m"]
    is_limit = limit_m > 0 and claim["status"] == ("clear" if limit_m <= 3 else "violation")
    per_second = check_proof.PER_SECOND[assumed["time_unit"]]
    return is_kept and is_limit and all(gap is None or gap * per_second >= 1 for gap in assumed["max_gaps_s"].values())


class Checker(unittest.TestCase):
    def expect(self, code, text, proof, message="", *options):
        found, out = run(proof, text, *options)
        self.assertEqual(found, code, out)
        self.assertIn(message, out)
        lines = out.splitlines()
        self.assertTrue(out.endswith("\n") and all(line.startswith("assumes  ") for line in lines[1:]), out)
        self.assertTrue(len(lines) == 1 or code == CONFIRMED, out)
        return out

    def test_the_output_states_every_fact_that_the_table_does_not_contain(self):
        out = self.expect(CONFIRMED, table(), proof_of(table(), offsets_s={"b": 0.0}))
        self.assertEqual(
            out.splitlines(),
            [
                "CONFIRMED: clear, never closer than 3.0 m, a and b at t = 4.5 s (limit 1.0 m)",
                "assumes  time: the column t is taken as s",
                "assumes  clocks: the times of all vehicles are of one clock",
                "assumes  vehicles: each name in `id` is one vehicle",
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
        seen = {"separation_m": math.sqrt(10), "status": "violation", "distance_m": 5.0}
        self.expect(CONFIRMED, gap, proof_of(gap, **seen), "; longer gaps, not judged: 2\n")
        self.expect(DENIED, gap, proof_of(gap, **seen | {"distance_m": 1.0, "status": "clear"}), "gives undecided")
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
        valid = proof_of(text, "abc", status="violation", separation_m=0.0)
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
        self.expect(UNREADABLE, text, old, "version 1 is not supported, 2 is; write the proof again with")

    def test_texts_of_numbers_are_exact_or_refused(self):
        text = table()
        valid = json.dumps(proof_of(text, max_gaps_s={"a": 1.25, "b": 1.25}))
        for number in ("3.0", "1.0", "1.25", "2"):
            for wrong in TEXTS:
                altered = valid.replace(f": {number}", f": {wrong}", 1)
                self.assertNotEqual(altered, valid)
                code, out = run(altered.encode(), text)
                # Any gap may be joined: the output states its length.
                is_gap = number == "1.25" and f"up to {wrong} s" in out
                self.assertTrue(code != CONFIRMED or is_gap, f"{wrong[:40]}: {out}")
        huge = valid.replace('"distance_m": 1.0', '"distance_m": 3.0000000000000000000000000000000001')
        self.expect(DENIED, text, huge.encode(), "gives violation, not clear: never closer than 3.0 m, a and b at")
        even = huge.replace("01}", "00}").encode()
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
            ("1234567890123456789", "1234567890123456790", 1, "clear"),
            ("1234567890123456789", "1234567890123456789.999", 1, "violation"),
        ):
            text = f"t,id,x,y,z\n0,a,{x},0,0\n0,b,{other},0,0\n1,a,{x},0,0\n1,b,{other},0,0\n"
            proof = proof_of(text, distance_m=limit, separation_m=limit, status=status)
            self.expect(CONFIRMED, text, proof, status)
            proof["claim"]["status"] = "violation" if status == "clear" else "clear"
            self.expect(DENIED, text, proof, f"gives {status}")

    def test_a_claim_that_no_rounding_explains_is_denied(self):
        for separation_m in (0, 2.9, 2.9999999, 3.0000001, 4):
            self.expect(DENIED, table(), proof_of(table(), separation_m=separation_m), "the separation is not ")
        self.expect(CONFIRMED, table(), proof_of(table(), separation_m=math.nextafter(3, 0)))
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
            self.expect(code, text, proof_of(text, time_unit="ms"), "in s by the table" if code else "taken as ms")
            self.expect(CONFIRMED, text, proof_of(text))

    def test_dates_are_read_to_the_nanosecond(self):
        dates = [f"2023-01-01T00:00:0{t}Z" for t in range(10)]
        others = [f'"2023-01-01t0{t}:30:0{t},000000000+0{t}30"' for t in range(10)]
        for times in (dates, others, [*dates[:5], *others[5:]]):
            text = table(times=times)
            out = self.expect(CONFIRMED, text, proof_of(text, time_unit="ns"), "at 2023-01-01T00:00:04.500000000Z (")
            self.assertIn("time: the column of time holds dates\n", out)
            self.expect(DENIED, text, proof_of(text), "the times are in ns by the table")
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
                proof = proof_of(text, names, gap_s=gap_s, pair=names[:2], separation_m=0)
                self.expect(DENIED, text, proof, "no two vehicles are present")
                continue
            least_m = math.sqrt(square)
            limit_m = least_m * dice.choice([0.5, 1 - 1e-12, 1 + 1e-12, 2]) or 0.5
            status = "violation" if square < Fraction(limit_m) ** 2 else "undecided" if is_hidden else "clear"
            claim = {"distance_m": limit_m, "separation_m": least_m, "pair": pair}
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


def random_table(dice):
    """A table of vehicles with steps and times of any kind, their samples as fractions, and the largest gap."""
    names = [f"v{k}" for k in range(dice.randrange(2, 6))]
    start, digits = dice.choice([0, 1_700_000_000, -50]), dice.choice([0, 1, 3, 20])
    size = dice.choice([10, 10**6, 10**-6])
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


def alterations(proof):
    """Yields a description of an alteration, and the altered proof."""
    claim = proof["claim"]
    for factor in (0.999999, 1.000001):
        yield f"separation_m {factor}", changed(proof, ("claim", "separation_m"), claim["separation_m"] * factor)
    yield "status", changed(proof, ("claim", "status"), "violation" if claim["status"] == "clear" else "clear")
    far = claim["separation_m"] * (0.999 if claim["status"] == "violation" else 1.001)
    yield "limit", changed(proof, ("claim", "limit", "distance_m"), far)
    yield "vehicle", changed(proof, ("assumed", "max_gaps_s", claim["pair"][0]), MISSING)
    yield "clock", changed(proof, ("assumed", "offsets_s", claim["pair"][0]), 1e9)


def main():
    if not unittest.main(argv=["proofs"], exit=False).result.wasSuccessful():
        sys.exit("the checker fails")
    confirmed = altered = refused = 0
    for path in sorted(Path(FOLDER).glob("*.json")):
        proof, data = json.loads(path.read_text()), path.with_suffix(".csv").read_bytes()
        offsets = [f"--offset={name}={by_s}" for name, by_s in proof["assumed"]["offsets_s"].items()]
        code, out = run(proof, data, *(word for option in offsets for word in option.split("=", 1)))
        if path.with_suffix(".refused").exists():
            refused += code == UNREADABLE
            continue
        if code != CONFIRMED:
            sys.exit(f"{path}: {out}")
        confirmed += 1
        for what, other in alterations(proof):
            if run(other, data)[0] == CONFIRMED:
                sys.exit(f"{path}: not denied: {what}")
            altered += 1
        if run(proof, data + b"\n")[0] != DENIED:
            sys.exit(f"{path}: not denied: other data")
    print(f"{confirmed} confirmed, {refused} refused, {altered} altered and denied")


main()
