"""Plots of answers. The module is imported when a plot is drawn, because it needs matplotlib."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends import backend_agg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ._display import COLOURS, PATHS

if TYPE_CHECKING:
    from ._answers import Answer, Margin, Share, Sweep
    from ._audit import Audit, Tracks
    from ._flight import Flight
    from ._judgement import Finding

FigureCanvas: Any = backend_agg.FigureCanvasAgg
#: Sizes of figures [inch]: a single plot, and two beside each other.
SINGLE, DOUBLE = (7.0, 4.5), (10.0, 4.5)
#: Largest number of pairs whose separations are drawn over time.
MAX_PAIRS = 5
#: Largest difference between a drawn and a found smallest separation, as a share of the limit.
TOLERANCE = 0.01
#: Motions between samples for which positions on straight lines are drawn.
DRAWN_MOTIONS = ("straight", "run-audit")
#: Predicates of flights that show the verdict of a margin or a sweep, and of flights that do not.
VERDICTS = {
    "pass": ("passes", "fails"),
    "clear": ("stays clear", "does not stay clear"),
    "reached": ("reaches its formation", "does not reach its formation"),
}


class Plot(Figure):
    """A figure that notebooks show without pyplot."""

    def _repr_png_(self) -> bytes:
        file, canvas = io.BytesIO(), FigureCanvas(self)
        canvas.print_png(file)
        return file.getvalue()


def axes_of(given: object, count: int = 1, size: tuple[float, float] = SINGLE) -> tuple[Figure, list[Any]]:
    """Returns the given axes and their figure, or those of a new figure with ``count`` plots."""
    if given is None:
        figure = Plot(figsize=size, layout="constrained")
        return figure, list(figure.subplots(1, count, squeeze=False)[0])
    axes = [given] if isinstance(given, Axes) else list(np.ravel(np.asarray(given, dtype=object)))
    if not all(isinstance(one, Axes) for one in axes) or not 1 <= len(axes) <= count:
        several = "" if count == 1 else f", or {count} of them,"
        raise TypeError(f"ax: axes of matplotlib{several} are needed, not {given!r}")
    within: Any = axes[0].figure
    return within if isinstance(within, Figure) else within.get_figure(root=True), axes


def flight(found: Flight, given: object) -> Figure:
    """Draws paths from above, and on the second axes the smallest separation over time with delta."""
    figure, (above, *beside) = axes_of(given, 2, DOUBLE)
    above.plot(found.positions[:, :, 0], found.positions[:, :, 1], linewidth=1)
    above.scatter(found.positions[-1:, :, 0], found.positions[-1:, :, 1], s=16, color="black", zorder=3)
    above.set(xlabel="x [m]", ylabel="y [m]", title=found.scenario.name)
    above.set_aspect("equal", adjustable="datalim")
    for over_time in beside:
        over_time.plot(found.t, found.separations_m, label="smallest separation")
        over_time.axhline(found.scenario.delta_m, color="tab:red", label="delta")
        over_time.set(xlabel="t [s]", ylabel="separation [m]", title=found.headline.partition(":")[0])
        over_time.legend()
    return figure


def audit(found: Audit, tracks: Tracks | None, given: object) -> Figure:
    """Draws the separations of the closest pairs over time with their limits, or as bars."""
    figure, (ax,) = axes_of(given)
    closest = list(found._findings("closest", found.vehicles))
    lines = None if tracks is None else separations(found, closest[:MAX_PAIRS], tracks)
    ax.set_title(found.verdict)
    if not closest:
        ax.text(0.5, 0.5, "no separations of vehicles", ha="center", transform=ax.transAxes)
    elif lines:
        draw_lines(ax, closest, lines)
    else:
        draw_bars(ax, closest)
    return figure


def draw_lines(ax: Any, closest: Sequence[Finding], lines: Sequence[tuple[NDArray[np.float64], ...]]) -> None:
    """Draws separations over time, a ring at each closest approach, and limits."""
    for k, ((t, distances), near) in enumerate(zip(lines, closest, strict=False)):
        colour = PATHS[k % len(PATHS)]
        ax.plot(t, distances, color=colour, linewidth=1.2, label=" and ".join(near.subjects))
        ax.plot([near.at_s], [near.lower], marker="o", markersize=6, markerfacecolor="none", color=colour)
    limits = sorted({near.limit for near in closest[: len(lines)] if near.limit is not None})
    for k, limit in enumerate(limits):
        ax.axhline(limit, color=COLOURS["bad"], linestyle="--", label="limit" if k == 0 else None)
    ax.set(xlabel="t [s]", ylabel="separation [m]")
    ax.set_ylim(bottom=0.0)
    ax.legend()


def draw_bars(ax: Any, closest: Sequence[Finding]) -> None:
    """Draws the smallest separations of pairs as bars, red below the limit, with their bounds and limits."""
    for k, near in enumerate(closest):
        lower, upper, limit = near.lower or 0.0, near.upper, near.limit
        colour = COLOURS["bad"] if limit is not None and lower < limit else PATHS[0]
        ax.barh(k, lower, height=0.7, color=colour)
        if upper is not None and np.isfinite(upper) and upper > lower:
            ax.plot([lower, upper], [k, k], color="black", linewidth=1)
        if limit is not None:
            label = "limit" if k == 0 else None
            ax.plot([limit, limit], [k - 0.45, k + 0.45], color="black", linestyle="--", label=label)
    ax.set_yticks(range(len(closest)), [" and ".join(near.subjects) for near in closest])
    ax.invert_yaxis()
    ax.set(xlabel=f"smallest separation [{closest[0].unit}]")
    if ax.get_legend_handles_labels()[0]:
        ax.legend()


def separations(
    found: Audit, closest: Sequence[Finding], tracks: Tracks
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]] | None:
    """Returns times and separations of pairs, or None where straight lines between samples do not show the findings."""
    motions = {fact.value for fact in found.facts if fact.fact == "motion"}
    if not motions <= set(DRAWN_MOTIONS) or any(near.unit != "m" for near in closest):
        return None
    lines = []
    for near in closest:
        if any(name not in tracks for name in near.subjects):
            return None
        gaps = [(gap.from_s, gap.to_s) for gap in found.gaps if gap.vehicle in near.subjects]
        line = separation(tracks[near.subjects[0]], tracks[near.subjects[1]], found["window_s"], gaps)
        least, lower = np.nanmin(line[1], initial=np.inf), near.lower or 0.0
        if not abs(least - lower) <= TOLERANCE * max(lower, near.limit or 0.0):
            return None
        lines.append(line)
    return lines


def separation(
    first: tuple[NDArray[np.float64], NDArray[np.float64]],
    second: tuple[NDArray[np.float64], NDArray[np.float64]],
    window_s: Sequence[float],
    gaps: Sequence[tuple[float, float]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns times and separations of two vehicles on straight lines between samples, with the smallest separation of
    each interval; NaN within gaps."""
    tracks = (first, second)
    if any(len(t) == 0 for t, _ in tracks):
        return np.empty(0), np.empty(0)
    from_s = max([window_s[0], *(t[0] for t, _ in tracks)])
    to_s = min([window_s[1], *(t[-1] for t, _ in tracks)])
    t = np.unique(np.concatenate([first[0], second[0], [from_s, to_s]]))
    t = t[(t >= from_s) & (t <= to_s)]
    places = [
        np.stack([np.interp(t, seen_s, p[:, axis]) for axis in range(p.shape[1])], axis=1) for seen_s, p in tracks
    ]
    apart = places[1] - places[0]
    change = np.diff(apart, axis=0)
    speed = (change**2).sum(axis=1)
    share = np.clip(-(apart[:-1] * change).sum(axis=1) / np.where(speed > 0, speed, 1.0), 0.0, 1.0)
    at = np.concatenate([t, t[:-1] + share * np.diff(t), [(a + b) / 2 for a, b in gaps]])
    distances = np.concatenate([
        np.linalg.norm(apart, axis=1),
        np.linalg.norm(apart[:-1] + share[:, None] * change, axis=1),
        np.full(len(gaps), np.nan),
    ])
    for a, b in gaps:
        distances[(at > a) & (at < b)] = np.nan
    order = np.argsort(at, kind="stable")
    return at[order], distances[order]


def answer(found: Answer, given: object) -> Figure | None:
    """Draws the first figure of the page of a study of laws or of a search. Returns None for another answer."""
    if "laws" in found:
        return laws(found, given)
    return search(found, given) if "progress" in found else None


def laws(found: Answer, given: object) -> Figure:
    """Draws the shares of flights of each law with a violation and in formation, or the probability of a violation."""
    rows = list(found.laws)
    figure, (ax,) = axes_of(given, size=(SINGLE[0], 1.5 + 0.5 * len(rows)))
    names = [str(row.name) for row in rows]
    rare = [row.get("splitting") for row in rows]
    if any(rare):
        for k, estimate in enumerate(rare):
            p = estimate["probability"] if estimate else {"value": None}
            if p["value"] is not None:
                bounds: list[Any] = [p["value"] if p[end] is None else p[end] for end in ("low", "high")]
                draw_interval(ax, p["value"], k, bounds[0], bounds[1], PATHS[0], None)
        ax.set_xlim(left=0.0)
        ax.set_xlabel("probability of a violation")
    else:
        for word, colour, offset in (("violated", COLOURS["bad"], -0.12), ("reached", COLOURS["good"], 0.12)):
            for k, row in enumerate(rows):
                draw_share(ax, row[word], k + offset, colour, word if k == 0 else None, bool(row.get("repeated")))
        ax.set(xlim=(-0.02, 1.02), xlabel="share of the flights")
        ax.legend()
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.5, -0.5)
    if given is None and len(found.headline) < 80:
        ax.set_title(found.headline, fontsize=10)
    return figure


def draw_share(ax: Any, share: Mapping[str, Any], y: float, colour: str, label: str | None, repeated: bool) -> None:
    """Draws a share as a dot, with its interval unless the flights are one flight repeated."""
    if share["share"] is not None:
        low, high = (share["share"],) * 2 if repeated else (share["low"], share["high"])
        draw_interval(ax, share["share"], y, low, high, colour, label)


def draw_interval(ax: Any, x: float, y: float, low: float, high: float, colour: str, label: str | None) -> None:
    """Draws a number as a dot with its interval."""
    ax.errorbar([x], [y], xerr=[[x - low], [high - x]], fmt="o", color=colour, capsize=3, label=label)


def search(found: Answer, given: object) -> Figure:
    """Draws the smallest separation found so far over the flights of a search."""
    figure, (ax,) = axes_of(given)
    steps = [(row["flight"], row["flown"]["min_m"]) for row in found["progress"] if row["flown"]["min_m"] is not None]
    if steps:
        flights, least = zip(*steps, strict=True)
        ends, label = (found["flights"], least[-1]), "smallest so far"
        ax.step([*flights, ends[0]], [*least, ends[1]], where="post", color=PATHS[0], label=label)
    ax.axhline(found["delta_m"], color=COLOURS["bad"], linestyle="--", label="delta")
    if found["own"]["min_m"] is not None:
        ax.axhline(found["own"]["min_m"], color="gray", linestyle=":", label="unchanged scenario")
    ax.set(xlabel="flights", ylabel="smallest separation [m]")
    ax.legend()
    return figure


def margin(found: Margin, given: object) -> Figure:
    """Draws the verdicts of flights, or the shares of runs with the verdict, over the values of the key."""
    figure, (ax,) = axes_of(given)
    probes = sorted(found.probes, key=lambda probe: probe.value)
    words = VERDICTS[found["question"]]
    if found["runs"] == 1 and all(probe.min_m is not None for probe in probes):
        ax.plot([probe.value for probe in probes], [probe.min_m for probe in probes], color="gray", linewidth=1)
        for holds, marker, colour, word in ((True, "o", PATHS[0], words[0]), (False, "x", COLOURS["bad"], words[1])):
            chosen = [probe for probe in probes if (probe.held.count == probe.held.of) == holds]
            values, lengths = [probe.value for probe in chosen], [probe.min_m for probe in chosen]
            ax.plot(values, lengths, marker, color=colour, label=word)
        ax.axhline(found["delta_m"], color="black", linestyle="--", label="delta")
        ax.set_ylabel("smallest separation [m]")
    else:
        draw_shares(ax, [(probe.value, probe.held, found["runs"] == 1 or probe.repeated) for probe in probes], words[0])
    for k, side in enumerate(found.turn.bracket if found.turn else ()):
        ax.axvline(side, color="gray", linestyle=":", label="the verdict turns in between" if k == 0 else None)
    ax.set(xlabel=found["key"], xscale="log" if found["logarithmic"] else "linear")
    ax.legend()
    return figure


def draw_shares(ax: Any, shares: Sequence[tuple[float, Share, bool]], word: str) -> None:
    """Draws shares of flights with a verdict over values, with their intervals unless a value has a single flight."""
    drawn = [(value, share, single) for value, share, single in shares if share.share is not None]
    values, heights = [value for value, _, _ in drawn], [share.share or 0.0 for _, share, _ in drawn]
    # A single flight has no interval.
    low = [0.0 if single else (share.share or 0.0) - share.low for _, share, single in drawn]
    high = [0.0 if single else share.high - (share.share or 0.0) for _, share, single in drawn]
    ax.errorbar(values, heights, yerr=[low, high], fmt="o-", color=PATHS[0], capsize=3, linewidth=1, label=word)
    ax.set(ylim=(-0.02, 1.02), ylabel=f"share that {word}")


def sweep(found: Sweep, given: object) -> Figure:
    """Draws the share of runs with the verdict over the values of a key, or as a map over two keys."""
    figure, (ax,) = axes_of(given)
    keys = found["grid"]
    word = VERDICTS[found["question"]][0]
    if len(keys) == 1:
        points = sorted(found.points, key=lambda point: point.values[0])
        draw_shares(ax, [(point.values[0], point.held, point.held.of <= 1 or point.repeated) for point in points], word)
        ax.set_xlabel(keys[0]["key"])
        return figure
    down, across = keys
    shares = np.full((len(down["values"]), len(across["values"])), np.nan)
    for point in found.points:
        if point.held.share is not None:
            shares[down["values"].index(point.values[0]), across["values"].index(point.values[1])] = point.held.share
    image = ax.imshow(shares, origin="lower", aspect="auto", vmin=0.0, vmax=1.0, cmap="viridis")
    figure.colorbar(image, ax=ax, label=f"share that {word}")
    ax.set_xticks(range(len(across["values"])), [f"{value:g}" for value in across["values"]])
    ax.set_yticks(range(len(down["values"])), [f"{value:g}" for value in down["values"]])
    ax.set(xlabel=across["key"], ylabel=down["key"])
    return figure
