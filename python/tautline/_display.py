"""HTML for notebooks: a verdict, a small table and a drawing, without scripts and without links."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

COLOURS = {"good": "#1a7f37", "bad": "#cf222e", "open": "#9a6700"}
PATHS = ("#0969da", "#bf3989", "#1a7f37", "#9a6700", "#8250df", "#cf222e", "#1b7c83", "#57606a")
WIDTH, HEIGHT, EDGE = 360, 240, 14
#: Largest numbers of vehicles, and of points of all vehicles, that are drawn: less than 20 kB.
MAX_VEHICLES, MAX_POINTS = 70, 800


def make_card(tone: str, verdict: str, rows: Iterable[tuple[str, str]], drawing: str = "") -> str:
    """Returns a verdict above a table of two columns, with a drawing beside the table."""
    cells = "".join(
        f"<tr><th style='text-align:left'>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>"
        for name, value in rows
    )
    badge = f"<p><b style='color:{COLOURS[tone]}'>{html.escape(verdict)}</b></p>"
    return f"<div>{badge}<div style='display:flex;flex-wrap:wrap;gap:1em'><table>{cells}</table>{drawing}</div></div>"


def draw_paths(positions: NDArray[np.float64], label: str) -> str:
    """Draws the paths of positions (T, N, 3) from above, each with a colour and a dot at its end."""
    if positions.size == 0:
        return ""
    points = max(2, MAX_POINTS // min(positions.shape[1], MAX_VEHICLES))
    plane = positions[:: -(-len(positions) // points), :MAX_VEHICLES, :2]
    plane = np.concatenate([plane, positions[-1:, :MAX_VEHICLES, :2]])
    low, high = np.nanmin(plane, axis=(0, 1)), np.nanmax(plane, axis=(0, 1))
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        return ""
    across, up = np.maximum(high - low, 1e-9)
    scale = min((WIDTH - 2 * EDGE) / across, (HEIGHT - 2 * EDGE) / up)
    middle = (low + high) / 2
    x = WIDTH / 2 + scale * (plane[..., 0] - middle[0])
    y = HEIGHT / 2 - scale * (plane[..., 1] - middle[1])
    parts = []
    for vehicle in range(plane.shape[1]):
        seen = np.isfinite(x[:, vehicle]) & np.isfinite(y[:, vehicle])
        if not seen.any():
            continue
        path = list(zip(x[seen, vehicle], y[seen, vehicle], strict=True))
        line = " ".join(f"{a:.1f},{b:.1f}" for a, b in path)
        colour = PATHS[vehicle % len(PATHS)]
        parts.append(f"<polyline points='{line}' fill='none' stroke='{colour}'/>")
        parts.append(f"<circle cx='{path[-1][0]:.1f}' cy='{path[-1][1]:.1f}' r='3' fill='{colour}'/>")
    return make_svg("".join(parts), label)


def draw_bars(names: Sequence[str], values: Sequence[float], limits: Sequence[float], label: str) -> str:
    """Draws distances as bars, red below their limits. A line marks each limit."""
    if not names:
        return ""
    most = max([*values, *limits]) or 1.0
    left, step = 110, (HEIGHT - 2 * EDGE) / len(names)
    scale = (WIDTH - left - EDGE) / most
    parts = []
    for k, (name, value, limit) in enumerate(zip(names, values, limits, strict=True)):
        top, thick = EDGE + k * step, 0.7 * step
        colour = COLOURS["bad"] if value < limit else PATHS[0]
        width = max(value, 0) * scale
        parts.append(f"<rect x='{left}' y='{top:.1f}' width='{width:.1f}' height='{thick:.1f}' fill='{colour}'/>")
        at = left + limit * scale
        parts.append(f"<line x1='{at:.1f}' x2='{at:.1f}' y1='{top:.1f}' y2='{top + thick:.1f}' stroke='currentColor'/>")
        parts.append(
            f"<text x='{left - 6}' y='{top + 0.75 * thick:.1f}' font-size='10' text-anchor='end' fill='currentColor'>"
            f"{html.escape(name[:18])}</text>"
        )
    return make_svg("".join(parts), label)


def import_plots() -> Any:
    """Imports the module of plots, and with it matplotlib."""
    try:
        from . import _plots
    except ImportError:
        raise ImportError("plots need matplotlib: pip install matplotlib") from None
    return _plots


def make_svg(inside: str, label: str) -> str:
    """Returns a drawing with a label for screen readers."""
    size = f"width='{WIDTH}' height='{HEIGHT}' viewBox='0 0 {WIDTH} {HEIGHT}'"
    return f"<svg xmlns='http://www.w3.org/2000/svg' {size} role='img' aria-label='{html.escape(label)}'>{inside}</svg>"
