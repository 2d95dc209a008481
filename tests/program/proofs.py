"""Tests of the checker of proofs.

Command: `python3 proofs.py check_proof.py FOLDER` with pairs of NAME.csv and NAME.json in FOLDER. Each proof of the
folder must be confirmed, and denied after each alteration. The tests of `Checker` write their own proofs.
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
from pathlib import Path

CHECKER, FOLDER = sys.argv[1:]
SPEC = importlib.util.spec_from_file_location("check_proof", CHECKER)
check_proof = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(check_proof)

CONFIRMED, DENIED, UNREADABLE = 0, 1, 2
MISSING = object()
# Values that replace each value of a proof.
WRONG = [MISSING, None, True, False, -1, 0, 1, 2, 7, -0.5, 0.5, 1e308, -1e308, 5e-324, 10**400, -(2**63)]
WRONG += [math.nan, math.inf, -math.inf, "", "x", "a", "3.0", "\ud800", "clear", "violation", "undecided", "ms"]
WRONG += [[], {}, [1], ["a"], [[]], {"a": 1}]


def is_denied(proof, data):
    try:
        check_proof.check(proof, data)
    except check_proof.Denied:
        return True
    return False


def alterations(proof, dice):
    """The proof with one thing altered each: what, and the proof."""

    def altered(what, change):
        other = copy.deepcopy(proof)
        change(other)
        return what, other

    claim = proof["claim"]
    for key in ("separation_m", "time_s"):
        for towards in (-math.inf, math.inf):
            number = math.nextafter(claim[key], towards)
            if number != claim[key]:
                yield altered(f"{key} {number!r}", lambda other: other["claim"].update({key: number}))
    if claim["limit_m"] == claim["separation_m"]:
        above = math.nextafter(claim["limit_m"], math.inf)
        yield altered("limit_m", lambda other: other["claim"].update(limit_m=above))
    pairs = [[a, b] for a in claim["vehicles"] for b in claim["vehicles"] if a < b and {a, b} != set(claim["pair"])]
    if pairs:
        pair = dice.choice(pairs)
        yield altered(f"pair {pair}", lambda other: other["claim"].update(pair=pair))
    missing = dice.randrange(len(proof["windows"]))
    yield altered(f"window {missing} is missing", lambda other: other["windows"].pop(missing))
    status = "violation" if claim["status"] == "clear" else "clear"
    yield altered("status", lambda other: other["claim"].update(status=status))
    box = dice.choice(proof["windows"][missing]["boxes"])
    axis = dice.randrange(4, 7)

    def shrink(other):
        at = other["windows"][missing]["boxes"][proof["windows"][missing]["boxes"].index(box)]
        at[axis] = math.nextafter(at[axis], -math.inf)

    yield altered("a box", shrink)


def table(header="t,id,x,y,z", row="{t},{id},{x},{y},0", ids=("a", "b"), times=range(10)):
    """Rows of two vehicles that pass each other 3 m apart at 4.5 s."""
    rows = [row.format(t=time, id=ids[0], x=k, y=0) for k, time in enumerate(times)]
    rows += [row.format(t=time, id=ids[1], x=9 - k, y=3) for k, time in enumerate(times)]
    return "".join(f"{line}\n" for line in (header, *rows))


def proof_of(text, ids=("a", "b"), boxes=(), clock=None, **claim):
    """Proof of a `table`, with `boxes` of further vehicles."""
    boxes = [[0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0], [1, 0.0, 3.0, 0.0, 9.0, 3.0, 0.0], *boxes]
    usual = {"status": "clear", "motion": "linear", "limit_m": 1.0, "separation_m": 3.0, "time_s": 4.5, "offsets_s": {}}
    usual |= {"pair": list(ids[:2]), "vehicles": list(ids), "max_gaps_s": [1.5] * len(ids)}
    usual["clock"] = {"unit": "s", "inferred": False, "epoch_ns": 0} | (clock or {})
    edges = [-1e9, 5.0, 1e9]
    return {
        "format": "tautline proof",
        "version": 1,
        "data": {"recording": "data.csv", "sha256": hashlib.sha256(text.encode()).hexdigest()},
        "claim": usual | claim,
        "windows": [
            {"from_s": begin, "to_s": end, "boxes": copy.deepcopy(boxes)} for begin, end in zip(edges, edges[1:])
        ],
    }


def run(proof, data):
    """Returns the exit code and the output of the checker. `proof` is JSON, or the bytes of a file."""
    files = {
        "proof.json": proof if type(proof) is bytes else json.dumps(proof).encode(),
        "data.csv": data if type(data) is bytes else data.encode(),
    }
    check_proof.open = lambda path, mode: io.BytesIO(files[path])
    # The encoding is that of a terminal without Unicode.
    out, error = io.TextIOWrapper(io.BytesIO(), encoding="ascii"), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        code = check_proof.main([*files])
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


def is_true(proof):
    """Whether the claim of a proof of `table()` is true."""
    claim = proof["claim"]
    is_kept = claim["separation_m"] == 3 and sorted(claim["pair"]) == ["a", "b"] == claim["vehicles"]
    is_kept &= claim["time_s"] == 4.5 and claim["motion"] == "linear"
    is_kept &= all(abs(by_s) < 1e-300 for by_s in claim["offsets_s"].values())
    is_kept &= claim["clock"]["unit"] == "s" and claim["clock"]["epoch_ns"] == 0
    is_limit = claim["limit_m"] > 0 and claim["status"] == ("clear" if claim["limit_m"] <= 3 else "violation")
    return is_kept and is_limit and all(gap_s is None or gap_s >= 1 for gap_s in claim["max_gaps_s"])


class Checker(unittest.TestCase):
    def expect(self, code, text, proof, said=""):
        found, out = run(proof, text)
        self.assertEqual(found, code, out)
        self.assertIn(said, out)
        self.assertEqual(out.count("\n"), 1, out)
        return out

    def test_a_number_sign_begins_a_comment_above_the_header_alone(self):
        comment = "# t,id,x,y,z\n#\n"
        self.expect(CONFIRMED, comment + table(), proof_of(comment + table()))
        ids = ("a", "b", "#c")
        for y, code in ((0.1, DENIED), (50, CONFIRMED)):
            text = table("id,t,x,y,z", "{id},{t},{x},{y},0") + "".join(f"#c,{t},{t},{y},0\n" for t in range(10))
            self.expect(DENIED, text, proof_of(text), "#c is missing")
            self.expect(code, text, proof_of(text, ids, [[2, 0.0, y, 0.0, 9.0, y, 0.0]]))

    def test_the_line_states_what_the_claim_assumes(self):
        out = self.expect(CONFIRMED, table(), proof_of(table(), offsets_s={"b": 0.0}))
        said = "clear, never closer than 3.0 m, a and b (limit 1.0 m); straight between samples up to 1 s apart"
        self.assertEqual(out, f"CONFIRMED: {said}; times in s\n")
        moved = proof_of(table(), offsets_s={"a": 100.0, "b": 100.0}, time_s=104.5)
        self.expect(CONFIRMED, table(), moved, ", with clocks moved: a by 100.0 s, b by 100.0 s;")
        text = table(times=range(0, 10_000, 1000))
        inferred = proof_of(text, clock={"unit": "ms", "inferred": True})
        self.expect(CONFIRMED, text, inferred, "; times in ms (inferred)\n")
        far = proof_of(table(times=range(0, 100, 10)), time_s=45.0, max_gaps_s=[None, 10.0])
        self.expect(CONFIRMED, table(times=range(0, 100, 10)), far, "straight between samples up to 10 s apart;")
        # No other vehicle is seen in the gap of c.
        alone = table() + "".join(f"{t},c,50,0,0\n" for t in (20, 21, 31, 32))
        gap = proof_of(alone, ("a", "b", "c"), [[2, 50.0, 0.0, 0.0, 50.0, 0.0, 0.0]])
        self.expect(CONFIRMED, alone, gap, ", gaps not judged: 1;")
        # Neither vehicle is joined from 4 s to 14 s.
        times = [0, 1, 2, 3, 4, 14, 15, 16, 17, 18]
        seen = {"time_s": 4.0, "separation_m": math.nextafter(math.sqrt(10), 0), "limit_m": 5.0, "status": "violation"}
        self.expect(CONFIRMED, table(times=times), proof_of(table(times=times), **seen), ", gaps not judged: 2;")
        clear = seen | {"limit_m": 1.0, "status": "clear"}
        self.expect(DENIED, table(times=times), proof_of(table(times=times), **clear), "undecided")

    def test_identical_rows_count_once(self):
        self.expect(CONFIRMED, table() + "9,b,0,3,0\n9,b,0.0,3,0\n", proof_of(table() + "9,b,0,3,0\n9,b,0.0,3,0\n"))
        for row in ("9,b,0,3,0.1\n", "8,b,1,3,0\n"):
            self.expect(UNREADABLE, table() + row, proof_of(table() + row), "at two places at")

    def test_a_row_without_a_position_is_of_a_vehicle_that_is_not_seen(self):
        self.expect(CONFIRMED, table() + "10,a,, ,\n", proof_of(table() + "10,a,, ,\n"))
        self.expect(CONFIRMED, table() + "10,c,,,\n", proof_of(table() + "10,c,,,\n", ("a", "b", "c")))
        self.expect(DENIED, table() + "10,c,,,\n", proof_of(table() + "10,c,,,\n"), "c is missing")
        self.expect(DENIED, table(), proof_of(table(), ("a", "b", "c")), "c is missing")
        rows = ("10,a,,0,\n", ",a,,,\n", "10,,9,0,0\n", "10,a,,\n")
        for row in (*rows, "10,a,nan,0,0\n", "10,a,1_0,0,0\n", "1e999,a,9,0,0\n"):
            self.expect(UNREADABLE, table() + row, proof_of(table() + row), "data, line 22: must")

    def test_dates_are_read_to_the_nanosecond(self):
        epoch_ns = 1_672_531_200_000_000_000
        dates = [f"2023-01-01T00:00:0{t}Z" for t in range(10)]
        others = [f'"2023-01-01t0{t}:30:0{t},000000000+0{t}30"' for t in range(10)]
        for times in (dates, others, [*dates[:5], *others[5:]]):
            text = table(times=times)
            self.expect(CONFIRMED, text, proof_of(text, clock={"unit": "ns", "epoch_ns": epoch_ns}))
            self.expect(UNREADABLE, text, proof_of(text, clock={"epoch_ns": epoch_ns}), "the unit of dates is ns")
            late = proof_of(text, clock={"unit": "ns", "epoch_ns": epoch_ns + 1})
            self.expect(DENIED, text, late, "not as close as")
        wrong_dates = ("2023-01-01T00:00:09", "2023-01-01T00:00:60Z", "2023-02-30T00:00:09Z")
        for wrong in (*wrong_dates, "2023-01-01T00:00:09+99:00"):
            text = table(times=[*dates[:9], wrong])
            self.expect(UNREADABLE, text, proof_of(text, clock={"unit": "ns", "epoch_ns": epoch_ns}), "data, line 11: ")

    def test_times_are_rounded_as_tautline_rounds_them(self):
        epoch_ns = 1_700_000_000_000_000_000
        # Digits count where they are plain. A number with an exponent is the nearest double first, to 2.4e-7 s here.
        for unit, text, time_s in (
            ("s", "1700000004", 4.0),
            ("s", "1700000004.3", 4.3),
            ("s", "1700000004.300000001", 4.300000001),
            ("s", "1.7000000043e9", 4.299999952316284),
            ("ms", "1700000000001", 0.001),
            ("ns", "1700000000000000001", 1e-9),
        ):
            self.assertEqual(check_proof.read_time(text, {"unit": unit, "epoch_ns": epoch_ns}), time_s, text)

    def test_columns_that_may_change_the_reading_are_refused(self):
        text = table("t,name,id,x,y,z", "{t},n{id},{id},{x},{y},0")
        self.expect(UNREADABLE, text, proof_of(text, ("na", "nb")), "column name may name the vehicles")
        text = table("t,id,name,x,y,z", "{t},{id},n{id},{x},{y},0")
        self.expect(CONFIRMED, text, proof_of(text))
        self.expect(DENIED, text, proof_of(text, ("na", "nb")), "is missing")
        for name in ("vx", "battery", "name", "alt", "latency_ms", "qw", "wind_x_m_s", "battery (V)"):
            text = table(f"t,id,x,y,z,{name}", "{t},{id},{x},{y},0,1")
            self.expect(CONFIRMED, text, proof_of(text))
        parts = ("T", "time [ms]", "nsec", "t_ns", "header.stamp.nanosec", "timestamp", "\u00b5s")
        for name in (*parts, "radius", "Radius1", "ref_lat"):
            text = table(f"t,id,x,y,z,{name}", "{t},{id},{x},{y},0,1")
            self.expect(UNREADABLE, text, proof_of(text), "may change the times or the limit")
        wrong = ("t,id,x,y", "t,id,x,y,X", "t,id,x,y,z,x", "t,id,x,y,z,time")
        for header in (*wrong, "t,id,x,y,z,a;b;c;d;e", "t\t\t\t\t\t,id,x,y,z"):
            text = table(header, "{t},{id},{x},{y},0" + ",1" * (header.count(",") - 4))
            self.expect(UNREADABLE, text, proof_of(text), "data: must have the columns")
        text = table("0 (,t,id,x,y,z", "1,{t},{id},{x},{y},0")
        self.expect(UNREADABLE, text, proof_of(text), "may change the times or the limit")

    def test_lines_end_as_tautline_ends_them(self):
        for name in ("b\u2028c", "b\x85c", "b\x0cc", "b\x1c", 'b"c', "b,c"):
            text = table(ids=("a", '"' + name.replace('"', '""') + '"' if name[1] in '",' else name))
            self.expect(CONFIRMED, text, proof_of(text, ("a", name)), f"a and {ascii(name)} (limit")
            self.expect(DENIED, text, proof_of(text, ("a", "b")), "is missing")
        mixed = table().replace("\n", "\r\n").replace("5,a", "\n \t\r\n5,a")
        for text in (mixed, "\ufeff" + table(), table("t,id,x,y,z,")):
            self.expect(CONFIRMED, text, proof_of(text))
        text = table() + '9,"a\n",9,0,0\n'
        self.expect(UNREADABLE, text, proof_of(text), "data, line 22: unexpected end of data")
        data = table().encode() + b"9,\xff,9,0,0\n"
        proof = proof_of("") | {"data": {"sha256": hashlib.sha256(data).hexdigest()}}
        self.expect(UNREADABLE, data, proof, "UnicodeDecodeError")

    def test_limits_are_positive_and_finite(self):
        limits = ((-5.0, -4.0), (0.0, 3.0), (math.nan, 3.0), (math.inf, 3.0))
        for limit_m, separation_m in (*limits, (1.0, -4.0), (1.0, math.nan)):
            proof = proof_of(table(), limit_m=limit_m, separation_m=separation_m)
            self.expect(UNREADABLE, table(), proof, "must be a finite number of ")
        self.expect(CONFIRMED, table(), proof_of(table(), limit_m=5e-324))
        self.expect(CONFIRMED, table(), proof_of(table(), limit_m=3.5, status="violation"))

    def test_boxes_are_of_vehicles_of_the_claim(self):
        for box in ([7, *[0.0] * 6], [-1, *[0.0] * 6], [True, *[0.0] * 6], [0.0] * 7, [0, 0.0]):
            proof = proof_of(table(), boxes=[box])
            self.expect(UNREADABLE, table(), proof, "a box must have a vehicle below 2 and 6 numbers")
        for box in ([], [1, *[math.nan] * 6], 0, "box"):
            self.expect(UNREADABLE, table(), proof_of(table(), boxes=[box]))
        self.expect(CONFIRMED, table(), proof_of(table(), boxes=[[1, 0.0, 3.0, -1.0, 9.0, 3.0, 1.0]]))
        self.expect(DENIED, table(), proof_of(table(), boxes=[[1, 0.0, 3.0, 1.0, 9.0, 3.0, 1.0]]), "leaves its box")

        still = table() + "0,c,50,0,0\n9,c,50,0,0\n"
        ids, gaps = ("a", "b", "c"), {"max_gaps_s": [None] * 3}
        self.expect(CONFIRMED, still, proof_of(still, ids, [[2, 50.0, 0.0, 0.0, 50.0, 0.0, 0.0]], **gaps))
        self.expect(DENIED, still, proof_of(still, ids, **gaps), "has none")

    def test_windows_cover_the_recording(self):
        for edges in ([(-1, 9)], [(0, 5), (5, 9)], [(0, 4), (4, 4), (4, 10)]):
            proof = proof_of(table())
            boxes = proof["windows"][0]["boxes"]
            proof["windows"] = [{"from_s": begin, "to_s": end, "boxes": boxes} for begin, end in edges]
            self.expect(CONFIRMED, table(), proof)
            first, last = proof["windows"][0], proof["windows"][-1]
            for window, key, time_s in ((first, "from_s", 1e-9), (last, "to_s", 8.9)):
                kept = window[key]
                window[key] = time_s
                self.expect(DENIED, table(), proof, "the windows do not cover the recording")
                window[key] = kept
            proof["windows"].insert(1, {"from_s": 0, "to_s": 5, "boxes": boxes})
            self.expect(DENIED, table(), proof, "the windows do not cover the recording")

    def test_the_vehicles_are_lists_of_names_that_differ(self):
        for wrong in (
            {"vehicles": "ab"},
            {"vehicles": ["a", "b", "b"], "max_gaps_s": [1.5] * 3},
            {"pair": "ab"},
            {"pair": ["a", "a"]},
            {"pair": ["a", "b", "a"]},
            {"pair": ["a", "c"]},
            {"offsets_s": {"c": 1.0}},
            {"max_gaps_s": [1.5]},
        ):
            self.expect(UNREADABLE, table(), proof_of(table(), **wrong))

    def test_a_malformed_proof_is_unreadable(self):
        valid = proof_of(table(), clock={"inferred": True}, offsets_s={"a": 0.0})
        self.expect(CONFIRMED, table(), valid)
        self.assertTrue(is_true(valid))
        paths = list(nodes(valid))
        self.assertGreater(len(paths), 60)
        for path in paths:
            for value in WRONG:
                proof = copy.deepcopy(valid)
                parent = at(proof, path[:-1])
                if value is MISSING:
                    del parent[path[-1]]
                else:
                    parent[path[-1]] = value
                code, out = run(proof, table())
                self.assertNotIn("Traceback", out)
                self.assertTrue(code != CONFIRMED or is_true(proof), f"{path} {value!r}: {out}")
                types = (int, float, type(at(valid, path)))
                is_typed = type(path[-1]) is int if value is MISSING else type(value) in types
                self.assertTrue(code != DENIED or is_typed or path[-1] == "sha256", f"{path} {value!r}: {out}")

    def test_damaged_files_exit_with_a_message(self):
        dice = random.Random(7)
        valid = proof_of(table(), clock={"inferred": True}, offsets_s={"a": 0.0})
        for _ in range(1500):
            proof, data = bytearray(json.dumps(valid).encode()), bytearray(table().encode())
            changed = dice.choice((proof, data))
            for _ in range(dice.randrange(1, 4)):
                changed[dice.randrange(len(changed))] = dice.choice(b"\x00\n\r\t \"'#,;-.0159aeENtz{}[]:\x85\xff")
            if changed is data:
                proof = json.dumps(valid | {"data": {"sha256": hashlib.sha256(data).hexdigest()}}).encode()
            code, out = run(bytes(proof), bytes(data))
            self.assertRegex(out, "^(CONFIRMED|DENIED|UNREADABLE): ")
            is_correct = code != CONFIRMED or changed is data or is_true(json.loads(bytes(proof)))
            self.assertTrue(is_correct, f"{proof!r}: {out}")
        for proof in (b"", b"[" * 100_000, b"null", b"[]", b'{"claim": []}', b"9" * 5000, b'"\\ud800"', b"\xff"):
            self.assertEqual(run(proof, table())[0], UNREADABLE)

    def test_a_name_cannot_print_a_line_of_its_own(self):
        name = "\nCONFIRMED: clear"
        self.expect(UNREADABLE, table(), proof_of(table(), ("a", name), offsets_s={name: "x"}))
        self.expect(DENIED, table(), proof_of(table(), ("a", name)), r"vehicle '\nCONFIRMED: clear' is missing")


def main():
    if not unittest.main(argv=["proofs"], exit=False).result.wasSuccessful():
        sys.exit("the checker fails")
    dice = random.Random(31)
    confirmed = altered = 0
    for path in sorted(Path(FOLDER).glob("*.json")):
        proof, data = json.loads(path.read_text()), path.with_suffix(".csv").read_bytes()
        check_proof.check(proof, data)
        confirmed += 1
        for what, other in alterations(proof, dice):
            if not is_denied(other, data):
                sys.exit(f"{path}: not denied: {what}")
            altered += 1
        if not is_denied(proof, data + b"\n"):
            sys.exit(f"{path}: not denied: other data")
    print(f"{confirmed} confirmed, {altered} altered and denied")


main()
