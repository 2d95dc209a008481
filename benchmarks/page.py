"""The benchmarks as Markdown, and the block of a page that the command replaces."""

import math
import pathlib
from collections.abc import Iterable, Sequence
from typing import Any

from missions import UNSEEN
from sampling import TOOLS
from speed import SAME_M, SLOT_M

Row = dict[str, Any]

BEGIN = "<!-- benchmarks: begin; python benchmarks/run.py --markdown replaces this block -->"
END = "<!-- benchmarks: end -->"

SPEED = (
    "Both sides run on one core, in turns; the least time of the rounds counts. A ratio above 1 means that tautline "
    "is faster; one in bold is a loss. Parentheses contain the smallest and the largest ratio of a round. A tilde "
    "replaces a ratio if 1 is within this spread."
)
GRAPH = (
    "Parentheses contain the time of the law. The rest of a step is energy check, engine and audit in tautline, and "
    "engine alone in a peer. The law in Numba is code of this project, compiled with fastmath, and evaluates each "
    "pair once."
)
QUADROTORS = (
    "The two sides fly Crazyflies with different models and controllers. A lattice contracts from a spacing of 0.8 m "
    f"to 0.7 m within 5 s. Each vehicle must end within {SLOT_M:g} m of its slot. "
)
WORLDS = (
    "crazyflow is built for many worlds on an accelerator. Here it flies one world on one core."
)
MISSIONS = (
    "Scenes are rebuilt from the published parameters below; random ones are other draws of the same distribution. "
    "Vehicles are points. Commands have a limit, so no law has a certificate without the shield. Cells give numbers "
    "of flights that succeeded without/under the shield, and in parentheses those that collided, if any; `-` was not "
    "flown, and `of` gives another number of flights. A flight *succeeded* if it is clear throughout, with each "
    "vehicle at its goal to the end. A collision is *hidden* if no sample at the source's rate shows it. `*`: the law "
    "does not support ellipsoids. Without the shield it flies in heights that are divided such that the ellipsoids "
    "are balls. All its limits are divided too, so that the true ones hold."
)
LAWS = (
    "A flight under the displacement law ends at the limit, so its smallest separation is just below the limit. This "
    "law has no limit on speed; its gains keep a lone vehicle below the limit. `orca` and `cbf-qp` have their default "
    "gains; those of `bvc` and `cbf-qp braking` arrived soonest of five choices over other seeds. The shield holds "
    "commands for 0.05 s, or less if the displacement law needs it. Only the displacement law and the shield avoid "
    "blocks, walls and columns. RVO2 has no limit on acceleration: its own method may succeed where `orca` collides."
)
PUBLISHED = "Published rates of the sources' own methods beside the best laws here, over all flights of a row:"
SAMPLING = (
    "Cells give the separation at samples and, in parentheses, on straight lines between the samples [m], rounded "
    "down. The whole motion decides the verdict. A cell in bold does not show a violation."
)


class NoBlock(Exception):
    """A page without exactly one block. The message names the two lines that mark it."""


def replace(page: str, report: dict[str, Any]) -> str:
    """Returns the page with a new block. Raises `NoBlock` unless both marks stand once, in order."""
    if page.count(BEGIN) != 1 or page.count(END) != 1 or page.index(BEGIN) > page.index(END):
        raise NoBlock(f"no block to replace; add the lines `{BEGIN}` and `{END}`")
    head, rest = page.split(BEGIN)
    return head + BEGIN + "\n\n" + block(report) + "\n" + END + rest.split(END)[1]


def block(report: dict[str, Any]) -> str:
    """Returns all tables of a report."""
    groups: dict[str, list[Row]] = {}
    for row in report["rows"]:
        groups.setdefault(row["group"], []).append(row)
    parts = [run(report)]
    if "speed" in groups:
        parts += speed(groups["speed"])
    if "missions" in groups:
        parts += missions(groups["missions"], report["program"])
    if "sampling" in groups:
        parts += sampling(groups["sampling"])
    parts += left_out(report["rows"])
    return "\n\n".join(parts) + "\n"


def run(report: dict[str, Any]) -> str:
    machine = report["machine"]
    load = f"{machine['load_before']:.1f} before and {machine['load_after']:.1f} after the run"
    text = f"`{report['program']}` ({report['build']} build) on {machine['processor']}, {machine['cores']} cores."
    if report["quick"]:
        text += "\nThis was a quick run with small sizes."
    text += f"\nThe load was {load}."
    if max(machine["load_before"], machine["load_after"] - 1) >= 0.5:
        text += " Other work ran beside it, so absolute times are too long."
    versions = [peer["versions"] for peer in report["peers"] if peer["status"] == "installed"]
    return text + "\n" + wrapped(["Peers: " + "; ".join(versions) + "." if versions else "No peer was installed."])


def speed(rows: Sequence[Row]) -> list[str]:
    shown = [row for row in rows if row["status"] == "measured"]
    lines = []
    for row in shown:
        peer, unit = row["peer"], row["unit"]
        theirs = f"{peer['name']} {peer['version']}: {times(peer, unit)}"
        lines.append((row["work"], times(row["ours"], unit), theirs, ratio(row)))
    text = [
        "## Speed beside peers",
        wrapped([SPEED + rounds(shown)]),
        table(("work", "tautline", "peer", "ratio"), lines),
    ]
    if not shown:
        return [text[0], "No row was measured."]
    same = [row for row in shown if "difference_m" in row and row["name"].startswith("complete-graph")]
    if same:
        worst = max(row["difference_m"] for row in same)
        same_text = (
            "On the complete graph both sides fly the same law with the same step from the same start. Their last "
            f"positions differ by at most {worst:.1g} m; a row with more than {SAME_M:g} m has no ratio."
        )
        text += [wrapped([GRAPH]), wrapped([same_text])]
    flown = [row for row in shown if "end_m" in row["peer"]]
    if flown:
        ours_m, theirs_m = (max(row[side]["end_m"] for row in flown) for side in ("ours", "peer"))
        ends = f"The largest distances are {ours_m:.2g} m in tautline and {theirs_m:.2g} m in a peer. "
        worlds = WORLDS if any(row["peer"]["name"] == "crazyflow" for row in flown) else ""
        text.append(wrapped([(QUADROTORS + ends + worlds).strip()]))
    sides = sorted({f"- tautline, {kind(row)}: {row['ours']['settings']}." for row in shown})
    sides += sorted({f"- {row['peer']['name']}, {kind(row)}: {row['peer']['settings']}." for row in shown})
    return [*text, "Settings:", wrapped(sides)]


def rounds(rows: Sequence[Row]) -> str:
    """Returns a sentence with the numbers of rounds of the rows."""
    counts = sorted({row["rounds"] for row in rows})
    return f" Rounds of a row: {' or '.join(map(str, counts))}." if counts else ""


def times(side: Row, unit: str) -> str:
    """Returns the time of a side, with that of the law if it is known."""
    text = time(side["time"], unit)
    if "parts" in side:
        text += f" (law {time(side['parts']['law'], unit)})"
    return text


def ratio(row: Row) -> str:
    """Returns the ratio with its spread over the rounds. A spread that contains 1 leaves no ratio."""
    smallest, largest = row["smallest_ratio"], row["largest_ratio"]
    spread = "one round" if row["rounds"] == 1 else f"{smallest:.3g} to {largest:.3g}"
    if smallest <= 1 <= largest:
        return f"~ within the spread ({spread})"
    text = f"{row['ratio']:.3g}"
    return f"{text if smallest > 1 else f'**{text}**'} ({spread})"


def kind(row: Row) -> str:
    return str(row["name"]).split("/")[0].replace("-", " ")


def missions(rows: Sequence[Row], program: str) -> list[str]:
    shown = [row for row in rows if row["status"] == "measured"]
    laws = list(dict.fromkeys(row["law"] for row in shown))
    missions: dict[str, dict[tuple[str, bool], Row]] = {}
    for row in shown:
        missions.setdefault(row["mission"], {})[row["law"], row["shield"]] = row
    lines = []
    for mission, use in missions.items():
        flights = max(row["flights"] for row in use.values())
        found = [cell(use.get((law, False)), use.get((law, True)), flights) for law in laws]
        lines.append((mission, f"{flights}", *found))
    sources = dict.fromkeys(
        f"- {row['mission'].split(',')[0]}: {row['source']}. Success: {row['success']}. Changes: {row['changes']}."
        for row in shown
    )
    return [
        "## Missions of other projects",
        wrapped([f"Flown with `{program}`; seeds count from 0. " + MISSIONS]),
        wrapped([LAWS + totals(rows)]),
        table(("mission", "flights", *laws), lines),
        *published(shown),
        wrapped(sources),
    ]


def cell(bare: Row | None, shielded: Row | None, flights: int) -> str:
    """Returns the numbers of flights that succeeded, and in parentheses those that collided if there are any.

    Numbers of flights other than `flights` follow `of`.
    """
    sides = (bare, shielded)
    text = "/".join(f"{row['succeeded']}{'*' if row.get('as_balls') else ''}" if row else "-" for row in sides)
    both = [row for row in sides if row]
    numbers = list(dict.fromkeys(row["flights"] for row in both))
    if any(number != flights for number in numbers):
        text += f" of {'/'.join(map(str, numbers))}"
    if any(row["collided"] for row in both):
        hidden = sum(row["hidden"] for row in both)
        text += f" ({'/'.join(str(row['collided']) if row else '-' for row in sides)}"
        text += f", {hidden} hidden)" if hidden else ")"
    return text


def published(shown: Sequence[Row]) -> list[str]:
    """Returns the table of published rates beside those of the best laws here."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in shown:
        if row.get("published"):
            groups.setdefault((row["mission"].split(",")[0], row["published"]), []).append(row)
    if not groups:
        return []
    lines = []
    above = None
    for (name, rate), rows in groups.items():
        counts = dict.fromkeys(row["mission"].split(", ")[1].split()[0] for row in rows)
        use = [best([row for row in rows if row["shield"] == shield]) for shield in (False, True)]
        why = rows[0]["why_other_rate"]
        lines.append((f"{name}, {' / '.join(counts)} agents", rate, *use, "as above" if why == above else why))
        above = why
    header = ("mission", "published", "here, best laws without the shield", "here, best laws under it", "difference")
    return [PUBLISHED, table(header, lines)]


def best(rows: Sequence[Row]) -> str:
    """Returns the laws with the largest share of flights that count as the published rate counts, and their counts."""
    found: dict[str, tuple[int, int]] = {}
    for row in rows:
        count, flights = found.get(row["law"], (0, 0))
        found[row["law"]] = (count + row[row["compared"]], flights + row["flights"])
    if not found:
        return "-"
    most = max(count / flights for count, flights in found.values())
    word = "clear" if rows[0]["compared"] == "safe" else "succeeded"
    laws: dict[tuple[int, int], list[str]] = {}
    for law, (count, flights) in found.items():
        if count / flights == most:
            laws.setdefault((count, flights), []).append(law)
    return "; ".join(f"{count} of {flights} {word} ({', '.join(names)})" for (count, flights), names in laws.items())


def totals(rows: Sequence[Row]) -> str:
    """Returns sentences with the collisions of all flights, and those that samples hide."""
    shown = [row for row in rows if row["status"] == "measured"]
    bare, shielded = (sum(row["collided"] for row in shown if row["shield"] == use) for use in (False, True))
    hidden, between = (sum(row[count] for row in shown) for count in UNSEEN)
    text = f" Flights that collided: {bare} without the shield, {shielded} under it."
    text += f" Flights with hidden collisions: {hidden}."
    if between:
        flights = "1 flight" if between == 1 else f"{between} flights"
        text += f" {flights} ended at the limit between two samples. Later samples are unknown, so such a flight does "
        text += "not count as hidden."
    return text


def sampling(rows: Sequence[Row]) -> list[str]:
    shown = [row for row in rows if row["status"] == "measured"]
    rates = sorted({row["rate_hz"] for row in shown})
    motions: dict[str, dict[float, Row]] = {}
    for row in shown:
        motions.setdefault(row["motion"], {})[row["rate_hz"]] = row
    lines = []
    for motion, by_rate in motions.items():
        whole = next(iter(by_rate.values()))
        verdict = "violation" if whole["violated"] else "clear"
        found = [sampled(by_rate[rate]) if rate in by_rate else "-" for rate in rates]
        lines.append((motion, f"{whole['delta_m']:g} m", f"{metres(whole['true_m'])} m", verdict, *found))
    return [
        "## What sampling hides",
        wrapped([SAMPLING]),
        table(("motion", "limit", "whole motion", "verdict", *(f"{rate:g} Hz" for rate in rates)), lines),
        *origins(rows),
        "Checks of other tools that see positions at samples only, each read in its source:",
        table(("tool", "check", "rate", "source"), TOOLS),
    ]


def sampled(row: Row) -> str:
    """Returns the separations at samples and between them, in bold if they belong to a violation without a sample."""
    text = f"{metres(row['samples_m'])} ({metres(row['straight_m'])})"
    return f"**{text}**" if row["violated"] and not row["seen_at_samples"] else text


def metres(length: float) -> str:
    """Returns a length rounded down to millimetres."""
    return f"{math.floor(1000 * length) / 1000:.3f}"


def origins(rows: Sequence[Row]) -> list[str]:
    """Returns the sources of published trajectories as a list."""
    lines = dict.fromkeys(f"- {row['motion']}: {row['source']}." for row in rows if row.get("source"))
    return ["Sources of trajectories:", wrapped(lines)] if lines else []


def left_out(rows: Iterable[Row]) -> list[str]:
    reasons: dict[tuple[str, str], dict[str, None]] = {}
    for row in rows:
        if row["status"] != "measured":
            scene, _, rest = row["name"].partition("/")
            reasons.setdefault((row["status"], row["why"]), {})[f"{scene.split(',')[0]}/{rest}"] = None
    if not reasons:
        return []
    lines = [f"- {'; '.join(names)}: {status}, {why}." for (status, why), names in reasons.items()]
    return ["## Rows without a figure", wrapped(lines)]


def time(value: float, unit: str) -> str:
    """Returns a time in a unit that needs no exponent."""
    seconds = value * {"us": 1e-6, "s": 1.0}[unit]
    for scale, name in ((1.0, "s"), (1e-3, "ms"), (1e-6, "us")):
        if seconds >= scale:
            return f"{seconds / scale:.3g} {name}"
    return f"{seconds / 1e-6:.3g} us"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def wrapped(lines: Iterable[str]) -> str:
    """Returns paragraphs or list items with lines of at most 118 characters."""
    text = []
    for line in lines:
        current = ""
        for word in line.split(" "):
            if current and len(current) + 1 + len(word) > 118:
                text.append(current)
                current = "  " + word if line.startswith("- ") else word
            else:
                current = f"{current} {word}" if current else word
        text.append(current)
    return "\n".join(text)


def write(path: pathlib.Path, text: str) -> None:
    """Writes a file under a temporary name and renames it."""
    temporary = path.with_name(path.name + ".part")
    temporary.write_text(text, encoding="utf-8")
    temporary.replace(path)
