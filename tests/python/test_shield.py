"""Tests of the shield in Python: alone, with messages as bytes, and in flights."""

from __future__ import annotations

import copy
import pickle
import runpy
import unittest
from collections.abc import Iterable
from typing import Any

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

    def test_irregular_instants_and_old_measurements_are_covered_and_checked(self) -> None:
        shield = self.shield(period_tolerance=0.1, hang_periods=2, measurement_age_s=0.1)
        p, v = np.array([[-3.0, 0.0, 0.0], [3.0, 0.1, 0.0]]), np.zeros((2, 3))
        elapsed_s, apart = PERIOD_S, []
        old = [(p, v)] * 2
        for k in range(120):
            # The measurement is that of the last instant or a new one.
            age_s = elapsed_s if k % 2 == 1 and elapsed_s <= 0.1 else 0.0
            measured = old[-2] if age_s > 0.0 else old[-1]
            u = shield.filter(*measured, dive(p), elapsed_s=elapsed_s, age_s=age_s)
            elapsed_s = (0.045, 0.055, 0.1, 0.165)[k % 4]
            for _ in range(50):
                dt = elapsed_s / 50
                p, v = p + v * dt + 0.5 * u * dt**2, v + u * dt
                apart.append(float(np.linalg.norm(p[1] - p[0])))
            old.append((p, v))
        self.assertGreaterEqual(min(apart), 1.0)
        report = shield.report()
        self.assertIsNone(report["exceeded"])
        facts = {fact["fact"]: fact for fact in report["assumptions"]}
        self.assertEqual([facts[kind]["held"] for kind in ("period", "age")], [True, True])
        shield.brake(p, v, elapsed_s=0.4)
        self.assertEqual(shield.report()["exceeded_code"], "period")
        with self.assertRaisesRegex(tl.Error, "hang_periods: "):
            self.shield(hang_periods=20)

    def test_a_shield_of_one_vehicle_speaks_in_bytes(self) -> None:
        starts = np.array([[-3.0, 0.0, 0.0], [3.0, 0.1, 0.0]])
        announced = [tl.Shield.start(p, delta_m=1.0, period_s=PERIOD_S) for p in starts]
        shields = [tl.Shield(starts=announced, delta_m=1.0, period_s=PERIOD_S, index=i) for i in range(2)]
        both = tl.Shield(starts, delta_m=1.0, period_s=PERIOD_S)
        p, v = starts.copy(), np.zeros((2, 3))
        inbox: list[list[bytes]] = [[], []]
        for _ in range(120):
            u = np.stack([shields[i].filter(p[i], v[i], dive(p)[i], inbox[i]) for i in range(2)])
            np.testing.assert_array_equal(u, both.filter(p, v, dive(p)))
            inbox = [[], []]
            for sender, shield in enumerate(shields):
                for receiver, message in shield.messages():
                    # Vehicles are counted from 0.
                    self.assertEqual((receiver, len(message)), (1 - sender, 64))
                    inbox[receiver].append(message)
            p, v = p + v * PERIOD_S + 0.5 * u * PERIOD_S**2, v + u * PERIOD_S
        self.assertGreaterEqual(float(np.linalg.norm(p[1] - p[0])), 1.0)
        self.assertEqual(shields[0].report()["assumptions"][0]["source"], "exchanged")
        self.assertEqual(both.report()["assumptions"][0]["source"], "proved")
        self.refuses(tl.Error, "lost: ", lambda: shields[0].filter(p[0], v[0], v[0], lost=np.zeros((2, 2))))

    def test_a_bound_that_was_exceeded_is_named(self) -> None:
        shield = self.shield()
        shield.filter([[-3, 0, 0], [3, 0.1, 0]], np.zeros((2, 3)), np.zeros((2, 3)))
        shield.filter([[-3, 0.5, 0], [3, 0.1, 0]], np.zeros((2, 3)), np.zeros((2, 3)))
        report = shield.report()
        self.assertIn("to the reference", report["exceeded"])
        self.assertEqual(report["exceeded_code"], "offset")
        self.assertIs({one["fact"]: one["held"] for one in report["assumptions"]}["tracking-error"], False)

    def test_wrong_settings_starts_and_shapes_are_refused(self) -> None:
        self.refuses(tl.Error, "brake_m_s2: must be at most 5", lambda: self.shield(brake_m_s2=9))
        self.refuses(tl.Error, "start: vehicles 1 and 2", lambda: self.shield(position_error_m=3.0, accel_m_s2=90))
        self.refuses(tl.Error, "index: the shield of one vehicle needs the starts", lambda: self.shield(index=2))
        self.refuses(TypeError, "mass_kg: is no setting of a shield", lambda: self.shield(mass_kg=2))
        announced = [tl.Shield.start([x, 0], delta_m=1.0, period_s=PERIOD_S) for x in (0, 5)]
        of = {"delta_m": 1.0, "period_s": PERIOD_S}
        self.refuses(tl.Error, "index: the number", lambda: tl.Shield(starts=announced, index=2, **of))
        self.refuses(tl.Error, "index: is needed", lambda: tl.Shield(starts=announced, **of))
        self.refuses(tl.Error, "positions: are needed", lambda: tl.Shield(**of))
        both = "starts: contain positions"
        self.refuses(tl.Error, both, lambda: tl.Shield([[0, 0]], starts=announced, index=0, **of))
        own = "start: the announced start of vehicle 2 is not that of its own settings"
        self.refuses(tl.Error, own, lambda: tl.Shield(starts=announced, index=1, max_speed_m_s=3, **of))
        altered = announced[0][:40] + b"?" + announced[0][41:]
        for wrong in (altered, b"", b"noise", "text"):
            starts: Any = [wrong, announced[1]]
            self.refuses(tl.Error, "starts[0]: start: ", lambda starts=starts: tl.Shield(starts=starts, index=1, **of))
        far = "use a local frame"
        self.refuses(tl.Error, far, lambda: tl.Shield.start([2e6, 0], **of))
        self.refuses(TypeError, "turn: a number", lambda: self.shield(turn="right"))
        shape = "positions: must have the shape (N, 3)"
        self.refuses(tl.Error, shape, lambda: tl.Shield([1, 2], delta_m=1, period_s=1))
        shield = self.shield()
        self.refuses(tl.Error, "wanted: ", lambda: shield.filter(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((3, 3))))
        zeros = np.zeros((2, 3))
        self.refuses(tl.Error, "lost: ", lambda: shield.filter(zeros, zeros, zeros, lost=np.zeros((3, 3))))
        # A command that is not finite brakes.
        self.assertTrue(np.isfinite(shield.filter([[-3, 0, 0], [3, 0.1, 0]], zeros, np.full((2, 3), np.nan))).all())


class OneEach(Case):
    """Shields of one vehicle each, with announced starts."""

    BASE = {"delta_m": 1.0, "period_s": 0.05, "ease_m": 0.0, "turn": 0.0}

    def fleet(self, ours: list[dict[str, Any]], apart_m: float, speed_m_s: float = 1.5) -> list[tl.Shield]:
        """Vehicles at 0 and apart_m; the second one flies at the first one."""
        starts = [
            tl.Shield.start([0, 0, 0], **ours[0]),
            tl.Shield.start([apart_m, 0, 0], [-speed_m_s, 0, 0], **ours[1]),
        ]
        return [tl.Shield(starts=starts, index=i, **ours[i]) for i in range(2)]

    def closest(self, shields: list[tl.Shield], periods_s: list[float], apart_m: float) -> float:
        """Dives without a radio, each vehicle at its own period. Returns the smallest distance."""
        p, v = np.array([[0.0, 0, 0], [apart_m, 0, 0]]), np.array([[0.0, 0, 0], [-1.5, 0, 0]])
        u, step_s = np.zeros((2, 3)), 0.01
        least = np.inf
        for step in range(600):
            for i, period_s in enumerate(periods_s):
                if step % round(period_s / step_s) == 0:
                    u[i] = shields[i].filter(p[i], v[i], 50.0 * (p[1 - i] - p[i]))
            p, v = p + v * step_s + 0.5 * u * step_s**2, v + u * step_s
            least = min(least, float(np.linalg.norm(p[1] - p[0])))
        return least

    def test_vehicles_with_different_settings_stay_apart(self) -> None:
        cases: list[tuple[dict[str, float], dict[str, float]]] = [
            ({"brake_m_s2": 3}, {"brake_m_s2": 1}),
            ({"accel_m_s2": 5}, {"accel_m_s2": 2}),
            ({"period_s": 0.02}, {"period_s": 0.2}),
        ]
        for pair in cases:
            ours = [self.BASE | own for own in pair]
            with self.subTest(pair=pair):
                for apart_m in (2.2, 2.6, 3.0):
                    try:
                        shields = self.fleet(ours, apart_m)
                    except tl.Error:
                        # The weaker vehicle needs more room, which both know.
                        self.assertLess(apart_m, 3.0)
                        continue
                    least = self.closest(shields, [own["period_s"] for own in ours], apart_m)
                    self.assertGreaterEqual(least, 1.0)
                    self.assertEqual([shield.report()["exceeded"] for shield in shields], [None, None])
        ours = [self.BASE, self.BASE | {"delta_m": 2.0}]
        self.refuses(tl.Error, "delta_m: vehicle 2 has another value", lambda: self.fleet(ours, 9.0))
        ours = [self.BASE, self.BASE | {"half_height_m": 2.0}]
        self.refuses(tl.Error, "half_height_m: vehicle 2 has another value", lambda: self.fleet(ours, 9.0))

    def exchange(self, shields: list[tl.Shield], periods: int, also: Iterable[bytes] = ()) -> list[bytes]:
        """Flies at each other with exact plants and a perfect radio. Returns all messages."""
        sent: list[bytes] = []
        inbox: list[list[bytes]] = [list(also), list(also)]
        p, v = np.array([[0.0, 0, 0], [2.2, 0, 0]]), np.zeros((2, 3))
        for _ in range(periods):
            u = np.stack([s.filter(p[i], v[i], 5.0 * (p[1 - i] - p[i]), inbox[i]) for i, s in enumerate(shields)])
            inbox = [[], []]
            for shield in shields:
                for receiver, message in shield.messages():
                    inbox[receiver].append(message)
                    sent.append(message)
            p, v = p + v * PERIOD_S + 0.5 * u * PERIOD_S**2, v + u * PERIOD_S
            self.assertGreaterEqual(float(np.linalg.norm(p[1] - p[0])), 1.0)
        return sent

    def still(self, **settings: float) -> list[tl.Shield]:
        return self.fleet([self.BASE | settings, self.BASE | settings], 2.2, 0.0)

    def test_other_starts_void_the_certificate_on_both_sides(self) -> None:
        starts = [tl.Shield.start([x, 0], **self.BASE) for x in (0.0, 2.2)]
        again = [starts[0], tl.Shield.start([2.2, 0], **self.BASE)]
        shields = [tl.Shield(starts=starts, index=0, **self.BASE), tl.Shield(starts=again, index=1, **self.BASE)]
        self.exchange(shields, 60)
        for i, shield in enumerate(shields):
            report = shield.report()
            self.assertEqual(report["exceeded_code"], "other-starts")
            self.assertEqual(report["exceeded"], f"vehicle {2 - i} holds other starts than this vehicle")
            self.assertEqual((report["other_starts_of"], report["accepted"] + report["refused"]), (1 - i, 0))
            self.assertGreater(report["other_starts"], 20)
            self.assertIs(report["assumptions"][0]["held"], False)

    def test_messages_of_an_earlier_flight_void_the_certificate(self) -> None:
        old = self.exchange(self.still(), 60)
        shields = self.still()
        self.exchange(shields, 60, old)
        self.assertEqual([s.report()["exceeded_code"] for s in shields], ["other-starts"] * 2)
        shields = self.still()
        self.exchange(shields, 60)
        self.assertEqual([s.report()["exceeded"] for s in shields], [None] * 2)

    def test_wrong_messages_are_dropped_and_counted_and_the_command_is_returned(self) -> None:
        shields = self.still()
        sent = self.exchange(shields, 20)
        wrong: list[Any] = [b"{}", b"", "text", None, 3, sent[0][:-1], sent[0] + b"0", bytes(64), np.zeros(3)]
        for place in range(64):
            wrong.append(sent[-1][:place] + bytes([sent[-1][place] ^ 0x10]) + sent[-1][place + 1 :])
        twin = copy.deepcopy(shields[0])
        p, v, u = np.zeros(3), np.zeros(3), np.ones(3)
        np.testing.assert_array_equal(shields[0].filter(p, v, u, wrong), twin.filter(p, v, u))
        self.assertEqual(shields[0].report()["invalid_messages"], len(wrong))
        # A bytearray or an array of bytes is as good. Messages to others and old ones have no effect.
        shields[0].filter(p, v, u, [bytearray(sent[-1]), np.frombuffer(sent[-2], dtype=np.uint8), *sent])
        self.assertEqual(shields[0].report()["invalid_messages"], len(wrong))

    def test_brakes_without_a_command_of_the_law(self) -> None:
        shield = self.fleet([self.BASE, self.BASE], 4.0)[1]
        p, v = np.array([4.0, 0, 0]), np.array([-1.5, 0, 0])
        for _ in range(30):
            u = shield.brake(p, v)
            self.assertEqual(u.shape, (3,))
            p, v = p + v * PERIOD_S + 0.5 * u * PERIOD_S**2, v + u * PERIOD_S
        self.assertLess(float(np.abs(v).max()), 1e-9)
        self.assertEqual(shield.report()["brakes"], 30)
        both = tl.Shield([[0, 0], [5, 0]], [[1, 0], [0, 1]], delta_m=1.0, period_s=PERIOD_S)
        u = both.brake([[0, 0], [5, 0]], [[1, 0], [0, 1]])
        np.testing.assert_allclose(u, [[-3, 0], [0, -3]])

    def test_a_copy_and_a_pickle_continue_with_the_same_bits(self) -> None:
        whole = tl.Shield([[0, 0, 0], [2.2, 0, 0]], delta_m=1.0, period_s=PERIOD_S)
        p, v = np.array([[0.0, 0, 0], [2.2, 0, 0]]), np.zeros((2, 3))
        shields = self.still()
        self.exchange(shields, 20)
        for _ in range(20):
            whole.filter(p, v, p)
        for original in (whole, shields[1]):
            for again in (copy.deepcopy(original), pickle.loads(pickle.dumps(original))):
                self.assertEqual((repr(again), again.report()), (repr(original), original.report()))
        copies = [copy.deepcopy(whole), pickle.loads(pickle.dumps(whole)), whole]
        for _ in range(20):
            first, second, third = (shield.filter(p, v, p[::-1] - p) for shield in copies)
            np.testing.assert_array_equal(first, second)
            np.testing.assert_array_equal(first, third)
        damaged = pickle.dumps(shields[1]).replace(b'"period":20', b'"period":21')
        self.refuses(tl.Error, "Shield: the bytes of the pickle are damaged", lambda: pickle.loads(damaged))

    def test_what_was_not_observed_is_none_and_what_was_is_judged(self) -> None:
        bounds = {"position_error_m": 0.01, "velocity_error_m_s": 0.02, "disturbance_m_s2": 0.1}
        p, v, h = np.array([[0.0, 0, 0], [4, 0, 0]]), np.zeros((2, 3)), PERIOD_S

        def fly(bias_m: float, push_m_s2: float, observes: bool) -> dict[str, Any]:
            shield = tl.Shield(p, delta_m=1.0, period_s=h, **bounds)
            self.assertEqual(shield.report()["command_share"], None)
            x, w = p.copy(), v.copy()
            for _ in range(100):
                measured = x + [0, bias_m, 0]
                if observes:
                    shield.observe_measurement(measured, w, x, w)
                u = shield.filter(measured, w, np.zeros((2, 3))) + [0, push_m_s2, 0]
                x, w = x + w * h + 0.5 * u * h**2, w + u * h
                if observes:
                    shield.observe(x, w, h)
            return shield.report()

        facts = lambda report: {one["fact"]: one for one in report["assumptions"]}  # noqa: E731
        unseen = fly(0.2, 0.0, False)
        self.assertEqual([unseen[f"{name}_share"] for name in ("tracking", "position", "velocity")], [None] * 3)
        one = facts(unseen)["position-error"]
        self.assertEqual((one["source"], one["held"], one["value"], one["unit"]), ("not-observable", None, 0.01, "m"))
        seen = fly(0.2, 0.0, True)
        self.assertEqual(seen["exceeded_code"], "measurement")
        self.assertIs(facts(seen)["position-error"]["held"], False)
        self.assertIs(facts(seen)["velocity-error"]["held"], True)
        pushed = fly(0.0, 2.0, True)
        self.assertEqual(pushed["exceeded_code"], "tube")
        self.assertIs(facts(pushed)["tracking-error"]["held"], False)
        held = fly(0.005, 0.05, True)
        self.assertIsNone(held["exceeded"])
        self.assertEqual(facts(held)["tracking-error"]["source"], "observed")
        self.assertIs(facts(held)["tracking-error"]["held"], True)
        self.assertLess(held["tracking_share"], 1.0)


class Dive(tl.Law):
    """Both vehicles fly at each other."""

    def control(self, obs: tl.Observation, out: NDArray[np.float64]) -> None:
        out[:] = 5.0 * (obs.positions[::-1] - obs.positions)


class Nothing(tl.Law):
    """No vehicle gets a command."""

    def control(self, obs: tl.Observation, out: NDArray[np.float64]) -> None:
        out[:] = np.nan


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
            self.assertEqual(flight.status, status)

    def test_a_start_on_converging_paths_is_refused_before_a_law_without_a_command(self) -> None:
        def text(apart_m: float, speed_m_s: float, angle_rad: float, more: str = "") -> str:
            file = self.folder / "long.toml"
            file.write_text(f"""
                name = "long"
                [start]
                positions_m = [[0, 0], [0, {apart_m}]]
                velocities_m_s = [[{speed_m_s}, 0], [{speed_m_s}, {-angle_rad * speed_m_s}]]
                [formation]
                shape = "points"
                points_m = [[0, 0], [0, 50]]
                [law]
                kind = "laplacian"
                delta_m = 1.0
                [shield]
                max_speed_m_s = {1.001 * speed_m_s}
                [time]
                duration_s = 20
                {more}
            """)
            return str(file)

        for speed_m_s in (50.0, 300.0):
            with self.assertRaises(tl.Error) as refused:
                tl.Scenario(text(1.00001, speed_m_s, 0.0))
            required_m = float(str(refused.exception).split("nearer than the ")[1].split(" m")[0])
            # Parallel paths keep this room, converging ones do not.
            near_m = required_m + 1e-5
            tl.Scenario(text(near_m, speed_m_s, 0.0))
            for angle_rad in (0.99e-7, 1e-6):
                file = text(near_m, speed_m_s, angle_rad)
                self.refuses(tl.Error, "reserve segments nearer", lambda file=file: tl.Scenario(file))
        flight = tl.fly(text(1.01, 50.0, 0.99e-7), law=Nothing())
        self.assertEqual((flight.status, flight.report["shield"]["exceeded"]), ("clear", None))
        aircraft = text(9.0, 1.0, 0.0, '[vehicle]\nmodel = "unicycle"')
        self.refuses(tl.Error, "no contract for unicycles", lambda: tl.fly(aircraft, law=Nothing()))

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
