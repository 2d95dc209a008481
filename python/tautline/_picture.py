"""Pictures of a world from above, for learning environments."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._display import PATHS
from ._native import Error
from .learning import Worlds

#: Sides of a picture [inch], and pixels per inch.
SIDES, DPI = (4.8, 4.8), 100


#: Modes of rendering.
RENDER_MODES = ["rgb_array", "human"]


def checked_mode(given: str | None) -> str | None:
    """Returns a known mode of rendering. Raises :class:`Error` for another one."""
    if given is not None and given not in RENDER_MODES:
        raise Error(f"render_mode: must be {' or '.join(RENDER_MODES)}, got {given!r}")
    return given


class Rendered:
    """Rendering of an environment with one world."""

    sim: Worlds
    render_mode: str | None
    _picture: Picture | None = None

    def render(self) -> NDArray[np.uint8] | None:
        """Returns a picture (height, width, 3), or shows it in a window. It needs matplotlib."""
        if self.render_mode is None:
            return None
        self._picture = self._picture or Picture(self.render_mode == "human")
        return self._picture.draw(self.sim, 0)

    def _show(self) -> None:
        """Shows the present state, if there is a window."""
        if self.render_mode == "human":
            self.render()

    def close(self) -> None:
        """Closes the window."""
        if self._picture is not None:
            self._picture.close()
        self._picture = None


class Picture:
    """Draws worlds: each vehicle as a ball of the diameter delta, its slot as a cross.

    It needs matplotlib. The frame of a picture is that of the last one, widened where vehicles or slots lie outside.
    """

    def __init__(self, is_shown: bool) -> None:
        if is_shown:
            from matplotlib import pyplot

            self.figure: Any = pyplot.figure(figsize=SIDES, dpi=DPI)
        else:
            from matplotlib.figure import Figure

            self.figure = Figure(figsize=SIDES, dpi=DPI)
        self.is_shown = is_shown
        self.axes = self.figure.add_axes((0.12, 0.1, 0.84, 0.84))
        self.extent: NDArray[np.float64] | None = None

    def draw(self, worlds: Worlds, world: int) -> NDArray[np.uint8] | None:
        """Draws a world. Returns the pixels (height, width, 3), unless the picture is shown in a window."""
        from matplotlib.collections import EllipseCollection

        p, slots = worlds.positions[world], worlds.slots_m[world]
        colours = [PATHS[i % len(PATHS)] for i in range(len(p))]
        ax, delta_m = self.axes, worlds.scenario.delta_m
        ax.clear()
        ax.scatter(slots[:, 0], slots[:, 1], marker="x", c=colours, linewidths=1)
        if worlds.scenario._native.obstacles:
            # Obstacles are known by their points that are nearest to vehicles.
            near = p[:, None, :2] + worlds.to_obstacles()[world][..., :2]
            ax.scatter(near[..., 0], near[..., 1], marker=".", c="#57606a", s=8)
        size = np.full(len(p), delta_m)
        balls = EllipseCollection(
            size, size, 0, units="xy", offsets=p[:, :2], offset_transform=ax.transData, facecolors=colours, alpha=0.8
        )
        ax.add_collection(balls)
        shown = np.concatenate([p[:, :2], slots[:, :2]])
        low, high = shown.min(axis=0) - delta_m, shown.max(axis=0) + delta_m
        if self.extent is not None:
            low, high = np.minimum(low, self.extent[0]), np.maximum(high, self.extent[1])
        self.extent = np.array([low, high])
        # A square frame has the scale of both axes.
        (x, y), half = (low + high) / 2, (high - low).max() / 2
        ax.set(xlim=(x - half, x + half), ylim=(y - half, y + half), xlabel="x [m]", ylabel="y [m]")
        ax.set_aspect("equal")
        clearance_m = worlds.least_clearance_m[world]
        ax.set_title(f"{worlds.t[world]:.2f} s, smallest clearance {clearance_m:.3f} m", fontsize=10)
        if self.is_shown:
            from matplotlib import pyplot

            self.figure.canvas.draw_idle()
            pyplot.pause(1e-3)
            return None
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        # A copy of a figure has no canvas of its own.
        canvas: Any = FigureCanvasAgg(self.figure)
        canvas.draw()
        return np.array(canvas.buffer_rgba())[..., :3].copy()

    def close(self) -> None:
        """Closes the window."""
        if self.is_shown:
            from matplotlib import pyplot

            pyplot.close(self.figure)
