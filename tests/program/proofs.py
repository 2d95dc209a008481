"""Holds the checker of proofs against the proofs in a folder: each is confirmed as it is, and denied where it is altered.

python3 proofs.py check_proof.py FOLDER, where FOLDER holds NAME.csv and NAME.json.
"""

import copy
import importlib.util
import json
import math
import random
import sys
from pathlib import Path

CHECKER, FOLDER = sys.argv[1:]
SPEC = importlib.util.spec_from_file_location("check_proof", CHECKER)
check_proof = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(check_proof)


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


def main():
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
