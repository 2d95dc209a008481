"""Tests of plots with matplotlib, and of the HTML that notebooks show."""

import pickle
import subprocess
import sys
import unittest

import numpy as np
import pandas
import tautline as tl
from matplotlib import pyplot
from matplotlib.figure import Figure
from shared import Case, passing, short

#: Largest HTML of an answer [byte].
MOST_BYTES = 20_000


def crossing() -> tuple[np.ndarray, np.ndarray]:
    """Returns a flight of three vehicles. Vehicles 1 and 2 pass each other at 0.1 m between two samples."""
    t = np.arange(11.0)
    p = np.zeros((11, 3, 3))
    p[:, 0, 0], p[:, 1, 0] = t - 4.5, 4.5 - t
    p[:, 1, 1], p[:, 2, 1] = 0.1, 5.0
    return t, p


def lines(figure: Figure) -> dict[str, np.ndarray]:
    """Returns the points of the lines with a label."""
    drawn = (line for line in figure.axes[0].lines if not str(line.get_label()).startswith("_"))
    return {str(line.get_label()): np.array(line.get_xydata()) for line in drawn}


class Audits(Case):
    def test_separations_over_time_show_the_approach_between_samples(self) -> None:
        t, p = crossing()
        frame = pandas.DataFrame({
            "t": np.repeat(t, 3),
            "id": ["1", "2", "3"] * 11,
            **{axis: p[:, :, k].ravel() for k, axis in enumerate("xyz")},
        })
        np.savez(self.folder / "p.npz", t=t, positions=p)
        for audit in (
            tl.audit(t, p, delta=0.5),
            tl.audit(t, p[:, :, :2], delta=0.5),
            tl.audit(frame, delta=0.5),
            tl.audit(frame.assign(t=frame.t + 1.7e9), delta=0.5, time_unit="s"),
            tl.audit(self.folder / "p.npz", delta=0.5, layout="time,vehicle,axis"),
        ):
            figure = audit.plot()
            drawn = lines(figure)
            self.assertEqual(list(drawn), ["1 and 2", "2 and 3", "1 and 3", "limit"])
            times, distances = drawn["1 and 2"].T
            self.assertAlmostEqual(distances.min(), audit.closest[0].lower, places=9)
            self.assertAlmostEqual(times[distances.argmin()], audit.closest[0].at_s)
            np.testing.assert_allclose(distances[::2], np.hypot(2 * t - 9, 0.1), atol=1e-6)
            np.testing.assert_allclose(drawn["limit"][:, 1], 0.5)
            self.assertEqual(figure.axes[0].get_title(), audit.verdict)

    def test_a_gap_breaks_the_line_and_a_window_ends_it(self) -> None:
        t, p = crossing()
        p[6:9, 2] = np.nan
        drawn = lines(tl.audit(t, p, delta=0.5, max_gap=1.0, from_s=2.0, until_s=9.5).plot())
        for pair in ("1 and 3", "2 and 3"):
            times, distances = drawn[pair].T
            self.assertEqual((times[0], times[-1]), (2.0, 9.5))
            unseen = times[np.isnan(distances)]
            self.assertTrue(len(unseen) and (unseen > 5).all() and (unseen < 9).all())
        self.assertTrue(np.isfinite(drawn["1 and 2"]).all())

    def test_other_motions_and_units_are_bars(self) -> None:
        t, p = passing()
        audit = tl.audit(t, p, delta=1.5)
        for other in (
            tl.audit(t, p, delta=1.5, motion="hold"),
            tl.audit(t, p, delta=1.5, motion="bounded", max_accel=1.0),
            tl.audit(t, p, delta=1.5, ellipsoid=(1.0, 1.0, 2.0)),
            tl.audit(t, p, cylinder=(1.5, 1.0)),
            pickle.loads(pickle.dumps(audit)),
        ):
            axes = other.plot().axes[0]
            self.assertEqual([bar.get_width() for bar in axes.patches], [near.lower for near in other.closest])
            self.assertEqual([text.get_text() for text in axes.get_yticklabels()][:1], ["1 and 2"])
            self.assertIn(other.closest[0].unit, axes.get_xlabel())
        self.assertEqual(len(tl.audit(t, p, limit={"speed": 1.0}).plot().axes[0].lines), 0)

    def test_the_run_of_a_flight_is_drawn_over_time(self) -> None:
        drawn = lines(tl.fly(short()).audit().plot())
        self.assertIn("2 and 3", drawn)


class Studies(Case):
    def test_shares_of_laws_have_their_intervals(self) -> None:
        spec = {"scenario": "pentagon", "runs": 4, "laws": ["edge-tension", "laplacian"]}
        spec |= {"set": {"time.duration_s": 2.0}, "vary": {"start.jitter_m": {"uniform": [0.0, 0.1]}}}
        for answer in (
            tl.compare(short(), ["edge-tension", "laplacian"], runs=4),
            tl.campaign(spec, self.folder / "camp", worst=0),
        ):
            axes = answer.plot().axes[0]
            dots = [bar.lines[0].get_xydata().tolist()[0] for bar in axes.containers]
            bars = [bar.lines[2][0].get_segments()[0][:, 0].tolist() for bar in axes.containers]
            shares = [law[word] for word in ("violated", "reached") for law in answer.laws]
            self.assertEqual([dot[0] for dot in dots], [share["share"] for share in shares])
            np.testing.assert_allclose(bars, [[share["low"], share["high"]] for share in shares], atol=1e-12)
            self.assertEqual([text.get_text() for text in axes.get_yticklabels()], ["edge-tension", "laplacian"])

    def test_margins_sweeps_and_searches(self) -> None:
        single = tl.margin("pentagon", "time.duration_s", 2, 60, scan=2, halvings=1)
        self.assertEqual(list(lines(single.plot())), ["passes", "fails", "delta", "the verdict turns in between"])
        several = tl.margin(short(), "law.alpha", 0.5, 2, scan=2, halvings=0, runs=3, verdict="clear")
        axes = several.plot().axes[0]
        self.assertEqual((axes.get_xlabel(), axes.get_ylabel()), ("law.alpha", "share that stays clear"))
        self.assertEqual(axes.containers[0].lines[0].get_xdata().tolist(), [0.5, 2.0])
        one = tl.sweep(short(), {"law.alpha": [2.0, 0.5]}).plot().axes[0]
        self.assertEqual((one.get_xlabel(), one.containers[0].lines[0].get_xdata().tolist()), ("law.alpha", [0.5, 2.0]))
        two = tl.sweep(short(), {"law.alpha": [0.5, 1.0, 2.0], "law.delta_m": [1, 9]}, verdict="clear")
        image = np.ma.filled(two.plot().axes[0].images[0].get_array(), np.nan)
        np.testing.assert_array_equal(image, [[1.0, np.nan]] * 3)
        found = tl.attack(short(), start=0.2, flights=5)
        drawn = lines(found.plot())
        self.assertEqual(drawn["smallest so far"][-1].tolist(), [5, found["progress"][-1]["flown"]["min_m"]])
        self.refuses(TypeError, "Check: this answer has no plot", lambda: tl.check("pentagon").plot())


class Axes(Case):
    def test_plots_draw_into_given_axes(self) -> None:
        self.addCleanup(pyplot.close, "all")
        flight, audit = tl.fly(short()), tl.audit(*crossing(), delta=0.5)
        figure, grid = pyplot.subplots(2, 2)
        self.assertIs(flight.plot(grid[0]), figure)
        self.assertIs(flight.plot(ax=grid[1, 0]), figure)
        self.assertIs(audit.plot(ax=grid[1, 1]), figure)
        self.assertEqual([len(ax.lines) > 0 for ax in grid.ravel()], [True] * 4)
        self.assertEqual(grid[0, 1].get_ylabel(), "separation [m]")
        self.refuses(TypeError, "ax: axes of matplotlib are needed, not 3", lambda: audit.plot(3))
        self.refuses(TypeError, "ax: axes of matplotlib are needed", lambda: audit.plot(grid[0]))
        self.refuses(TypeError, "or 2 of them", lambda: flight.plot(grid))
        self.assertEqual(pyplot.get_fignums(), [figure.number])

    def test_a_notebook_shows_a_figure_without_pyplot(self) -> None:
        code = (
            "import pickle, sys, numpy as np, tautline as tl\n"
            "figure = tl.audit([0.0, 1.0], np.eye(3)[[[0, 1], [2, 1]]], delta=1.0).plot()\n"
            "assert figure._repr_png_().startswith(b'\\x89PNG')\n"
            "assert pickle.loads(pickle.dumps(figure))._repr_png_().startswith(b'\\x89PNG')\n"
            "assert 'matplotlib.pyplot' not in sys.modules\n"
            "sys.modules['matplotlib'] = sys.modules['tautline._plots'] = None\n"
            "del sys.modules['tautline']._plots\n"
            "tl.fly('pentagon', set={'time.duration_s': 1.0}).plot()\n"
        )
        ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
        self.assertIn("ImportError: plots need matplotlib: pip install matplotlib", ran.stderr)


class Html(Case):
    def test_the_html_of_every_answer_is_small(self) -> None:
        rng = np.random.default_rng(0)
        names = [f"vehicle <{k}> with a name that is rather long" for k in range(80)]
        many = tl.audit(np.arange(60.0), 3 * rng.normal(size=(60, 80, 3)), delta=2.0, names=names, limit={"speed": 1.0})
        spec = {"scenario": "pentagon", "runs": 30, "laws": ["edge-tension", "laplacian", "displacement", "orca"]}
        spec |= {"set": {"time.duration_s": 1.0}, "vary": {"start.jitter_m": {"uniform": [0.0, 0.3]}}}
        thousand = {"time.duration_s": 1.0}
        for answer in (
            many,
            many.violations,
            many.closest,
            tl.campaign(spec, self.folder / "camp", worst=0),
            tl.compare(short(), runs=2, shield=True),
            tl.sweep(short(), {"law.alpha": list(np.linspace(0.5, 2.0, 30))}),
            tl.margin(short(), "law.alpha", 0.5, 2, scan=20, halvings=0),
            tl.attack("thousand", start=0.1, flights=2, set=thousand),
            tl.check("thousand"),
            tl.fly("thousand", set=thousand),
            tl.Scenario("thousand"),
        ):
            with self.subTest(answer=type(answer).__name__):
                shown = answer._repr_html_()
                self.assertLess(len(shown.encode()), MOST_BYTES)
                self.assertGreater(len(shown), 100)
                self.assertNotIn("vehicle <", shown)


if __name__ == "__main__":
    unittest.main()
