"""Tests of wrong input: it raises the right class of exception with the message of the command line."""

import unittest

import numpy as np
import tautline as tl
from shared import Case, Springs, passing, short


class Arrays(Case):
    def test_numbers_that_are_no_doubles_are_a_type_error(self) -> None:
        t, p = passing()
        record = np.zeros(p.size, dtype=[("a", "u1"), ("b", "f8")])["b"].reshape(p.shape)
        for message, times, positions in (
            ("real numbers of at most 64 bits are needed, not complex128", t, p.astype(complex)),
            ("not object", t, p.astype(object)),
            ("not bool", t, p > 0),
            ("not <U", t, p.astype(str)),
            ("not aligned", t, record),
            ("not object", t, [[[None, 0.0, 0.0]]] * 100),
            ("not dict", t, {"x": 1.0}),
            ("not str", t, "p"),
            ("masked", t, np.ma.masked_array(p)),
            ("needed beside the times", t, None),
            ("not int", 3, None),
        ):
            self.refuses(TypeError, message, lambda t=times, p=positions: tl.audit(t, p, delta=1.0))

    def test_integers_that_are_no_doubles_are_refused_beside_floats(self) -> None:
        import pandas
        import pyarrow

        big, message = 2**53, "is larger than 2^53 and is no float64"
        t, near = [0.0, 1.0], [[big + 1, 0.0, 0.0], [big + 3, 0.0, 0.0]]
        rows = [[np.array([big + 1, 0, 0]), np.array([0.5, 0.0, 0.0])]] * 2
        for times, positions in (
            (t, [near] * 2),
            (t, [tuple(map(tuple, near))] * 2),
            (t, rows),
            (t, [[[2**63 + 1, 0, 0], [-1, 0, 0]]] * 2),
            ([0.5, big + 1], [[[0.0] * 3, [2.0, 0.0, 0.0]]] * 2),
            (pyarrow.array([0, big + 1, None]), [[[0.0] * 3, [2.0, 0.0, 0.0]]] * 3),
            (pandas.DataFrame({"a": [0.5], "b": [big + 1]}), [[[0.0] * 3, [2.0, 0.0, 0.0]]] * 2),
        ):
            self.refuses(tl.Error, message, lambda t=times, p=positions: tl.audit(t, p, delta=3.0))
        # Floats of this size are exact, and so are integers up to 2^53.
        for far in (float(big), big):
            positions = [[[far, 0.0, 0.0], [far - 2, 0.0, 0.0]]] * 2
            self.assertEqual(tl.audit(t, positions, delta=1.0).separation_m, 2.0)
        sim = tl.Simulation("pentagon")
        self.refuses(tl.Error, message, lambda: sim.step([[big + 1, 0.5, 0.0]] * 5))
        rounded = "delta: the integer 9007199254740993 is no float64"
        self.refuses(tl.Error, rounded, lambda: tl.audit(*passing(), delta=big + 1))
        self.refuses(tl.Error, message, lambda: tl.Shield([[big + 1, 0.5], [0, 0]], delta_m=1, period_s=0.1))

    def test_masked_arrays_in_lists_are_refused(self) -> None:
        hidden = np.ma.masked_array(np.zeros((2, 3)), mask=True)
        for positions in ([hidden, hidden], [list(hidden), list(hidden)]):
            self.refuses(TypeError, "masked", lambda p=positions: tl.audit([0.0, 1.0], p, delta=1.0))

    def test_wrong_shapes_are_refused(self) -> None:
        t, p = passing()
        for message, times, positions in (
            ("(T, N, 3) or (T, N, 2) is needed, not of shape (1200,)", t, p.ravel()),
            ("the last axis is x, y and z", t, p[:, :, :1]),
            ("the last axis is x, y and z", t, np.zeros((len(t), 4, 4))),
            ("for 100 times; the first axis is time: give .swapaxes(0, 1)", t, p.swapaxes(0, 1)),
            ("for 5 times", t[:5], p),
            ("(T,) is needed, not of shape (100, 1)", t[:, None], p),
            ("holds nothing to judge", t[:0], p[:0]),
            ("holds nothing to judge", t, p[:, :0]),
            ("1 vehicle to judge, but no second object", t, p[:, :1]),
        ):
            self.refuses(tl.Error, message, lambda t=times, p=positions: tl.audit(t, p, delta=1.0))
        self.refuses(tl.Error, "velocities: they are of shape", lambda: tl.audit(t, p, delta=1.0, velocities=p[1:]))
        self.refuses(tl.Error, "names: 2 for 4 vehicles", lambda: tl.audit(t, p, delta=1.0, names=["a", "b"]))
        self.refuses(tl.Error, "the same name", lambda: tl.audit(t, p, delta=1.0, names=["a", "b", "a", "c"]))

    def test_numbers_that_are_not_finite_are_named_by_their_place(self) -> None:
        t, p = passing()

        def changed(array: np.ndarray, place: object, value: float) -> np.ndarray:
            copy = array.copy()
            copy[place] = value
            return copy

        for message, times, positions in (
            ("positions[10, 1]: it holds NaN", t, changed(p, (10, 1, 0), np.nan)),
            ("positions[10, 1]: it holds inf", t, changed(p, (10, 1, 2), np.inf)),
            ("t[7]: it is NaN", changed(t, 7, np.nan), p),
            ("t[7]: it is inf", changed(t, 7, np.inf), p),
            ("t[7]: time is repeated: 0.6000000000000001 s", changed(t, 7, t[6]), p),
            ("t[1]: time runs backwards", t[::-1], p),
            ("not a finite number below 1e70", t, 1e300 * p),
        ):
            self.refuses(tl.Error, message, lambda t=times, p=positions: tl.audit(t, p, delta=1.0))
        velocities = changed(np.zeros_like(p), (3, 0, 1), np.nan)
        message = "velocities[3, 0]: it holds NaN"
        self.refuses(tl.Error, message, lambda: tl.audit(t, p, delta=1.0, velocities=velocities))

    def test_wrong_options_have_a_message_in_words_of_python(self) -> None:
        t, p = passing()
        for message, options in (
            ("neither delta nor its radius is given", {}),
            ("delta: must be a finite number above 0, got -1.0 (give delta=NUMBER", {"delta": -1}),
            ("delta: must be a finite number above 0", {"delta": float("nan")}),
            ("[possible values: linear, hold, polynomial, bounded]", {"delta": 1, "motion": "spline"}),
            ("with max_accel=A or max_accel={\"NAME\": A}", {"delta": 1, "motion": "bounded"}),
            ("max_accel has no effect without motion=\"bounded\"", {"delta": 1, "max_accel": 2.0}),
            ("the window from 1.0 s to 0.5 s", {"delta": 1, "from_s": 1, "until_s": 0.5}),
            ("no vehicle zz", {"delta": 1, "ids": ["zz"]}),
            ("4 vehicles to judge, not 5", {"delta": 1, "expect_vehicles": 5}),
        ):
            self.refuses(tl.Error, message, lambda options=options: tl.audit(t, p, **options))
        self.refuses(TypeError, "delta: a number is needed, not str", lambda: tl.audit(t, p, delta="1"))
        self.refuses(TypeError, "a number is needed, not bool", lambda: tl.audit(t, p, delta=True))
        self.refuses(TypeError, "fps: only for files", lambda: tl.audit(t, p, delta=1, fps=30))
        self.refuses(TypeError, "unexpected keyword", lambda: tl.audit("a.csv", delta=1, bogus=1))

    def test_errors_have_codes(self) -> None:
        t, p = passing()
        for code, do in (
            ("audit/no-limit", lambda: tl.audit(t, p)),
            ("audit/limit-of-jumps", lambda: tl.audit(t, p, delta=1, motion="hold", limit={"speed": 5})),
            ("audit/radius-and-ellipsoid", lambda: tl.audit(t, p, radius=0.1, ellipsoid=[1, 1, 2])),
            ("scenario/unknown-key", lambda: tl.Scenario(set={"law.nope": 1})),
            ("request/out-of-range", lambda: tl.compare("pentagon", runs=0)),
            (None, lambda: tl.audit(t, p, delta=10**400)),
        ):
            with self.subTest(code), self.assertRaises(tl.Error) as caught:
                do()
            self.assertEqual(caught.exception.code, code)

    def test_many_vehicles_are_audited(self) -> None:
        side = 300
        p = np.zeros((2, side * side, 2))
        p[:, :, 0], p[:, :, 1] = 3.0 * (np.arange(side * side) % side), 3.0 * (np.arange(side * side) // side)
        self.assertEqual(tl.audit(np.array([0.0, 1.0]), p, delta=1.0).separation_m, 3.0)


class Files(Case):
    def test_missing_files_are_not_found(self) -> None:
        t, p = passing()
        for do in (
            lambda: tl.audit("none.csv", delta=1),
            lambda: tl.audit(t, p, delta=1, obstacles="none.toml"),
            lambda: tl.read("none.mcap"),
            lambda: tl.export("none.mcap", self.folder / "a.csv"),
            lambda: tl.Scenario("none.toml"),
            lambda: tl.fly(self.folder / "none"),
            lambda: tl.campaign("none.toml"),
        ):
            self.refuses(FileNotFoundError, "No such file", do)

    def test_errors_in_a_file_have_a_place(self) -> None:
        file = self.folder / "a.csv"
        file.write_text("t,id,x,y,z\n0,a,0,0,0\n0,b,1,0,x\n")
        self.refuses(tl.Error, "line 3", lambda: tl.audit(file, delta=0.5))
        self.refuses(tl.Error, "line 3", lambda: tl.read(file))
        file.write_bytes(b"\x00\x01\x02" * 100)
        self.refuses(tl.Error, "a.csv", lambda: tl.read(file))
        self.refuses(TypeError, "a path is needed, not int", lambda: tl.read(3))
        self.refuses(TypeError, "a path is needed, not bytes", lambda: tl.read(b"a.csv"))
        self.refuses(tl.Error, "none is given", lambda: tl.read([]))

    def test_a_file_that_cannot_be_written_is_an_os_error(self) -> None:
        missing = self.folder / "none"
        self.refuses(OSError, "cannot write", lambda: tl.fly(short(), record=missing / "run.mcap"))
        t, p = passing()
        self.refuses(OSError, "cannot write", lambda: tl.audit(t, p, delta=1).to_html(missing / "a.html"))


class Scenarios(Case):
    def test_errors_of_a_scenario_have_place_value_and_remedy(self) -> None:
        for message, do in (
            ("did you mean `pentagon`?", lambda: tl.Scenario("pentagn")),
            ("set:1:11: `dt_s` must be a number, got the text", lambda: tl.Scenario(set={"time.dt_s": "x"})),
            ("is not a key of an override", lambda: tl.Scenario(set={"a b": 1})),
            ("unknown key `nope`", lambda: tl.Scenario(set={"law.nope": 1})),
            ("TOML:1:1: unknown key `x`", lambda: tl.Scenario.from_toml("x = 3")),
            ("neither a built-in scenario nor a file", lambda: tl.Scenario("-")),
            ("neither a built-in scenario nor a file", lambda: tl.Scenario("")),
            ("no law has the name `nope`", lambda: tl.compare("pentagon", ["nope"])),
            ("from 5.0 to 5.0: both ends", lambda: tl.margin("pentagon", "time.control_hz", 5, 5)),
        ):
            self.refuses(tl.Error, message, do)
        self.refuses(TypeError, "a name or a path is needed, not int", lambda: tl.Scenario(3))
        self.refuses(TypeError, "a value of TOML is needed, not set", lambda: tl.Scenario(set={"name": {1}}))

    def test_too_many_vehicles_are_an_error(self) -> None:
        text = 'name = "many"\n[swarm]\ncount = 1000000000000\n[start]\nshape = "line"\nspacing_m = 3.0\n'
        text += '[formation]\nshape = "circle"\nradius_m = 5.0\n[law]\nkind = "displacement"\ndelta_m = 1.0\n'
        text += "[time]\nduration_s = 1.0\n"
        with self.assertRaises(tl.Error):
            tl.Scenario.from_toml(text)


class Simulations(Case):
    def test_wrong_steps_fly_nothing(self) -> None:
        sim = tl.Simulation(short())
        u = np.zeros((5, 3))
        wrong = np.where(np.arange(5)[:, None] == 2, np.nan, u)
        for kind, message, do in (
            (TypeError, "not object", lambda: sim.step(u.astype(object))),
            (TypeError, "an array is needed, not float", lambda: sim.step(1.0)),
            (tl.Error, "of shape (5, 3) are needed, not (4, 3)", lambda: sim.step(u[:4])),
            (tl.Error, "not (5, 1)", lambda: sim.step(u[:, :1])),
            (tl.Error, "not of shape (15,)", lambda: sim.step(u.ravel())),
            (tl.Error, "step 1: the command for vehicle 3 is not a finite number", lambda: sim.step(wrong)),
            (tl.Error, "steps: must be at least 1, got 0", lambda: sim.step(steps=0)),
            (TypeError, "a whole number is needed, not float", lambda: sim.step(steps=1.5)),
        ):
            self.refuses(kind, message, do)
        self.assertEqual(sim.steps, 0)
        sim.step(u[:, :2])
        self.assertEqual(sim.steps, 1)

    def test_a_flight_that_has_ended_cannot_be_stepped(self) -> None:
        sim = tl.Simulation(short())
        sim.step(steps=10_000)
        self.assertEqual((sim.ending, sim.t), ("completed", 2.0))
        self.refuses(tl.Error, "the flight has ended (completed)", sim.step)

    def test_anything_but_a_law_is_a_type_error(self) -> None:
        self.refuses(TypeError, "int has no method control", lambda: tl.fly(short(), law=3))
        self.refuses(TypeError, "str has no method control", lambda: tl.Simulation(short(), law="orca"))

        class Named(Springs):
            name = "edge-tension"

        self.refuses(tl.Error, "the name of the scenario's own law", lambda: tl.fly(short(), law=Named()))


if __name__ == "__main__":
    unittest.main()
