"""Tests of the shield in Python: alone, with messages as bytes, and in flights."""

from __future__ import annotations

import runpy
import unittest

import numpy as np
import tautline as tl
from numpy.typing import NDArray
from shared import ROOT, Case

PERIOD_S = 0.05
RECIPE = ROOT / "python" / "recipes" / "shielded_policy.py"


def dive(p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns commands of two vehicles towards each other."""
    return 5.0 * (p[::-1] - p)


def least(shield: tl.Shield | None, axes: int = 3) -> float:
    """Returns the smallest distance of two vehicles that dive at each other for ten seconds."""
    p = np.array([[-3.0, 0.0, 0.0], [3.0, 0.1, 0.0]])[:, :axes]
    v = np.zeros_like(p)
    apart = [np.inf]
    for _ in range(200):
        u = np.clip(dive(p), -5, 5) if shield is None else shield.filter(p, v, dive(p))
        p, v = p + v * PERIOD_S + 0.5 * u * PERIOD_S**2, v + u * PERIOD_S
        apart.append(float(np.linalg.norm(p[1] - p[0])))
    return min(apart)


class Alone(Case):
    """The shield as a library."""

    def shield(self, **settings: object) -> tl.Shield:
        return tl.Shield([[-3, 0, 0], [3, 0.1, 0]], delta_m=1.0, period_s=PERIOD_S, **settings)

    def test_two_vehicles_that_dive_stay_apart_in_the_plane_and_in_space(self) -> None:
        self.assertLess(least(None), 0.5)
        shield = self.shield()
        self.assertGreaterEqual(least(shield), 1.0)
        report = shield.report()
        self.assertIsNone(report["exceeded"])
        self.assertEqual(report["commands"], 400)
        self.assertGreater(report["changed"], 20)
        planar = tl.Shield([[-3, 0], [3, 0.1]], delta_m=1.0, period_s=PERIOD_S)
        self.assertGreaterEqual(least(planar, 2), 1.0)
        self.assertIn("certified never closer than 1.000 m", shield.certificate)
        self.assertIn("of 2 vehicles", repr(shield))

    def test_a_shield_of_one_vehicle_speaks_in_bytes(self) -> None:
        starts = np.array([[-3.0, 0.0, 0.0], [3.0, 0.1, 0.0]])
        shields = [tl.Shield(starts, delta_m=1.0, period_s=PERIOD_S, index=i) for i in range(2)]
        both = tl.Shield(starts, delta_m=1.0, period_s=PERIOD_S)
        p, v = starts.copy(), np.zeros((2, 3))
        inbox: list[list[bytes]] = [[], []]
        for _ in range(120):
            u = np.stack([shields[i].filter(p[i], v[i], dive(p)[i], inbox[i]) for i in range(2)])
            np.testing.assert_array_equal(u, both.filter(p, v, dive(p)))
            inbox = [[], []]
            for shield in shields:
                for receiver, message in shield.messages():
                    inbox[receiver].append(message)
            p, v = p + v * PERIOD_S + 0.5 * u * PERIOD_S**2, v + u * PERIOD_S
        self.assertGreaterEqual(float(np.linalg.norm(p[1] - p[0])), 1.0)
        self.refuses(tl.Error, "message: ", lambda: shields[0].filter(p[0], v[0], v[0], [b"{}"]))
        self.refuses(tl.Error, "lost: ", lambda: shields[0].filter(p[0], v[0], v[0], lost=np.zeros((2, 2))))

    def test_a_bound_that_was_exceeded_is_named(self) -> None:
        shield = self.shield()
        shield.filter([[-3, 0, 0], [3, 0.1, 0]], np.zeros((2, 3)), np.zeros((2, 3)))
        shield.filter([[-3, 0.5, 0], [3, 0.1, 0]], np.zeros((2, 3)), np.zeros((2, 3)))
        self.assertIn("to the reference", shield.report()["exceeded"])

    def test_wrong_settings_starts_and_shapes_are_refused(self) -> None:
        self.refuses(tl.Error, "brake_m_s2: must be at most 5", lambda: self.shield(brake_m_s2=9))
        self.refuses(tl.Error, "start: vehicles 1 and 2", lambda: self.shield(position_error_m=3.0, accel_m_s2=90))
        self.refuses(tl.Error, "index: ", lambda: self.shield(index=2))
        self.refuses(TypeError, "turn: a number", lambda: self.shield(turn="right"))
        shape = "positions: must have the shape (N, 3)"
        self.refuses(tl.Error, shape, lambda: tl.Shield([1, 2], delta_m=1, period_s=1))
        shield = self.shield()
        self.refuses(tl.Error, "wanted: ", lambda: shield.filter(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((3, 3))))
        zeros = np.zeros((2, 3))
        self.refuses(tl.Error, "lost: ", lambda: shield.filter(zeros, zeros, zeros, lost=np.zeros((3, 3))))
        # A command that is not finite brakes.
        self.assertTrue(np.isfinite(shield.filter([[-3, 0, 0], [3, 0.1, 0]], zeros, np.full((2, 3), np.nan))).all())


class Dive(tl.Law):
    """Both vehicles fly at each other."""

    def control(self, obs: tl.Observation, out: NDArray[np.float64]) -> None:
        out[:] = 5.0 * (obs.positions[::-1] - obs.positions)


class InFlights(Case):
    """The shield in flights and studies."""

    TOML = """
        name = "two"
        [start]
        positions_m = [[-3, 0], [3, 0]]
        [formation]
        shape = "points"
        points_m = [[3, 0], [-3, 0]]
        [law]
        kind = "laplacian"
        delta_m = 1.0
        [time]
        duration_s = 20
    """

    def scenario(self) -> str:
        file = self.folder / "two.toml"
        file.write_text(self.TOML)
        return str(file)

    def test_the_shield_certifies_the_law_of_the_file_and_a_law_in_python(self) -> None:
        file = self.scenario()
        self.assertFalse(tl.fly(file).passed)
        shielded = tl.fly(file, shield=True)
        self.assertTrue(shielded.passed, shielded.headline)
        self.assertIsNone(shielded.report["shield"]["exceeded"])
        self.assertGreater(shielded.report["shield"]["changed_share"], 0.0)
        for shield, status in ((False, "violation"), (True, "clear")):
            flight = tl.fly(file, law=Dive(), shield=shield)
            self.assertEqual(flight.report["audit"]["status"], status)

    def test_compare_flies_each_law_twice(self) -> None:
        answer = tl.compare(self.scenario(), ["laplacian"], shield=True, runs=2)
        self.assertEqual([row["name"] for row in answer.laws], ["laplacian+bare", "laplacian+shield"])

    def test_the_recipe_is_clear_with_the_shield_and_violates_without(self) -> None:
        fly = runpy.run_path(str(RECIPE))["fly"]
        audit, exceeded = fly(True, steps=200)
        self.assertEqual((audit.status, exceeded), ("clear", None))
        self.assertEqual(fly(False, steps=200)[0].status, "violation")


if __name__ == "__main__":
    unittest.main()
