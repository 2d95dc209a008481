"""Tests of audits of arrays and files: they have the verdicts of the command line, for any memory order."""

import os

import numpy as np
import tautline as tl
from shared import Case, passing, printed_json, short


class Arrays(Case):
    def test_a_violation_is_found_between_samples_and_named(self) -> None:
        t = np.array([0.0, 1.0])
        p = np.array([[[-5.0, 0, 0], [5.0, 1, 0]], [[5.0, 0, 0], [-5.0, 1, 0]]])
        a = tl.audit(t, p, delta=2.0, names=["alpha", "bravo"])
        self.assertEqual((a.verdict, a.separation_m, a.closest[0].subjects), ("VIOLATION", 1.0, ("alpha", "bravo")))
        closest = a.closest[0]
        self.assertEqual((closest.at_s, closest.lower, closest.upper, closest.unit, closest.limit), (0.5, 1, 1, "m", 2))
        self.assertEqual(tl.audit(t, p, delta=0.5).verdict, "CLEAR if straight between samples")

    def test_verdicts_equal_those_of_the_command_line(self) -> None:
        t, p = passing()
        tl_path = self.folder / "p.npz"
        np.savez(tl_path, t=t, positions=p, names=np.array(["1", "2", "3", "4"]))
        questions = {
            "CLEAR if straight between samples": ({"delta": 0.4}, ["--delta=0.4"]),
            "VIOLATION": ({"delta": 1.5}, ["--delta=1.5"]),
            "UNDECIDED": ({"delta": 0.4, "max_gap": 0.01}, ["--delta=0.4", "--max-gap=0.01"]),
            "PROVED CLEAR": (
                {"delta": 0.4, "motion": "bounded", "max_accel": 1.0},
                ["--delta=0.4", "--motion=bounded", "--max-accel=1"],
            ),
        }
        for verdict, (options, words) in questions.items():
            with self.subTest(verdict=verdict):
                a = tl.audit(t, p, **options)
                self.assertEqual(a.verdict, verdict)
                self.assertEqual(tl.audit(tl_path, **options).verdict, verdict)
                printed = printed_json(["audit", "--json", *words, str(tl_path)])
                ours = a.to_dict()
                for key in ("status", "proved", "question", "answers", "window_s", "vehicles", "gaps"):
                    self.assertEqual(ours[key], printed[key], key)

    def test_absent_vehicles_are_named_and_presence_can_be_required(self) -> None:
        t, p = passing()
        p = p.copy()
        p[len(t) // 2 :, 3] = np.nan
        a = tl.audit(t, p, delta=0.1)
        self.assertTrue(a.is_clear)
        self.assertIn("1 of 4 vehicles is not seen throughout: 4 is seen from", a.headline)
        strict = tl.audit(t, p, delta=0.1, require_presence=True)
        self.assertEqual((strict.status, strict.to_dict()["presence"]["partly"]), ("undecided", 1))
        self.assertTrue(tl.audit(t, p, delta=0.1, require_presence=True, ids=["1", "2", "3"]).is_clear)

    def test_accel_window_limits_mean_accelerations(self) -> None:
        t = np.arange(41) * 0.05
        p = np.zeros((41, 1, 3))
        p[:, 0, 0] = 3.0 * np.minimum(t, 1.0)
        limit = {"accel": 10.0}
        self.assertEqual(tl.audit(t, p, limit=limit).status, "violation")
        self.assertEqual(tl.audit(t, p, limit=limit, accel_window=0.4).status, "clear")
        self.assertEqual(tl.audit(t, p, limit=limit, accel_window=0.2).status, "violation")

    def test_cylinders_well_clear_and_rules_of_shows_are_judged(self) -> None:
        t = np.array([0.0, 1.0])
        p = np.array([[[-5, 0, 5], [5, 0.25, 5.5]], [[5, 0, 5], [-5, 0.25, 5.5]]], float)
        self.assertEqual(tl.audit(t, p, cylinder=(0.5, 0.6)).verdict, "VIOLATION")
        self.assertEqual(tl.audit(t, p, cylinder="0.5,0.4").verdict, "CLEAR if straight between samples")
        self.assertEqual(tl.audit(t, p, well_clear="do-365").verdict, "VIOLATION")
        self.assertEqual(tl.audit(t, p, rules="skybrush").verdict, "VIOLATION")
        self.assertEqual(tl.audit(t, p, ellipsoid="crazyswarm").verdict, "CLEAR if straight between samples")
        self.refuses(tl.Error, "above 0, got 0.0", lambda: tl.audit(t, p, cylinder=(0, 1)))
        self.refuses(tl.Error, "unknown rules `foo`", lambda: tl.audit(t, p, rules="foo"))

    def test_vehicles_land_on_named_obstacles_and_hit_all_others(self) -> None:
        t = np.array([0.0, 10.0])
        p = np.array([[[0.0, 0, 0], [5, 0, 0]], [[0, 0, 10], [5, 0, 10]]])
        ground = "[[obstacle]]\nname = 'ground'\nhalf_space = { normal = [0, 0, 1] }\nclearance_m = 0.5\n"
        solid = self.folder / "ground.toml"
        solid.write_text(ground, encoding="utf-8")
        options = {"delta": 1.0, "obstacles": solid, "above": 1.0}
        self.assertEqual(tl.audit(t, p, **options).verdict, "VIOLATION")
        landed = tl.audit(t, p, land_on=["ground"], **options)
        self.assertEqual(landed.verdict, "CLEAR above 1.000 m if straight between samples")
        self.assertIn("exempt for 1.000 s, landing on ground for 1.000 s of 10.000 s", landed.headline)
        self.refuses(tl.Error, "no obstacle `pad`", lambda: tl.audit(t, p, land_on=["pad"], **options))

    def test_seconds_of_an_obstacle_need_the_unit_of_time(self) -> None:
        file, truck = self.folder / "steps.csv", self.folder / "truck.toml"
        rows = [f"{t},a,0,0,0\n{t},b,0,30,0\n" for t in (0, 10, 20)]
        file.write_text("t,id,x,y,z\n" + "".join(rows), encoding="utf-8")
        path = "path = [[0, -20, 0, 0], [20, 20, 0, 0]]"
        truck.write_text(f"[[obstacle]]\nname = 'truck'\nball = {{ radius_m = 1.0 }}\n{path}\n", encoding="utf-8")
        options = {"delta": 1.0, "obstacles": truck}
        self.refuses(tl.Error, "the path of the obstacle `truck` depends on it", lambda: tl.audit(file, **options))
        self.assertEqual(tl.audit(file, time_unit="s", **options).verdict, "VIOLATION")

    def test_a_flight_is_compared_with_its_plan(self) -> None:
        t = np.array([0.0, 1.0])
        p = np.array([[[0.0, 0, 0], [0.0, 2, 0]], [[5.0, 0.1, 0], [5.0, 2, 0]]])
        plan = self.folder / "plan.csv"
        plan.write_text("t,id,x,y,z\n0.0,a,0,0,0\n0.0,b,0,2,0\n1.0,a,5,0,0\n1.0,b,5,2,0\n", encoding="utf-8")
        options = {"names": ["a", "b"], "plan": plan, "plan_delay": 0.0}
        found = tl.audit(t, p, delta=1.0, **options).plan
        assert found is not None
        self.assertAlmostEqual(found["vehicles"][0]["upper_m"], 0.1, places=9)
        self.assertTrue(found["certificate"]["holds"])
        self.assertEqual(tl.audit(t, p, tube=0.05, **options).status, "violation")
        self.assertIsNone(tl.audit(t, p, delta=1.0).plan)
        with self.assertRaisesRegex(TypeError, "only with a plan"):
            tl.audit(t, p, delta=1.0, tube=0.1)

    def test_a_flight_has_the_verdict_of_its_run_unless_independent(self) -> None:
        f = tl.fly("pentagon", set={"time.duration_s": 3})
        self.assertEqual(f.audit().verdict, "PROVED CLEAR by the run's audit of every step")
        self.assertEqual(f.audit().separation_m, f.separation_m)
        self.assertEqual(f.audit(independent=True, delta=2.0).verdict, "CLEAR if straight between samples")
        with self.assertRaises(ValueError):
            f.positions[0, 0, 0] = 0.0

    def test_the_memory_order_does_not_matter(self) -> None:
        rng = np.random.default_rng(1)
        t, p = np.arange(40) * 0.1, rng.normal(scale=5.0, size=(40, 5, 3))
        expected = tl.audit(t, p, delta=0.5).to_dict()
        orders = {
            "Fortran": np.asfortranarray(p),
            "axes swapped": np.ascontiguousarray(p.transpose(2, 1, 0)).transpose(2, 1, 0),
            "backwards": p[::-1].copy()[::-1],
            "every second": np.repeat(p, 2, axis=1)[:, ::2],
        }
        for order, same in orders.items():
            self.assertEqual(tl.audit(t, same, delta=0.5).to_dict(), expected, order)
        other = p.copy()
        other[7, 2, 1] += 3.0
        self.assertNotEqual(tl.audit(t, other, delta=0.5).to_dict(), expected)

    def test_positions_in_a_plane_have_no_heights(self) -> None:
        t, p = passing()
        flat, space = tl.audit(t, p[:, :, :2], delta=1.5), tl.audit(t, p, delta=1.5)
        self.assertEqual((flat.verdict, flat.separation_m), (space.verdict, space.separation_m))
        self.assertIn("in the plane of x and y", flat.notes[0])
        self.assertTrue(flat.headline.endswith("in the plane of x and y: no heights are known"), flat.headline)
        self.assertEqual((flat.is_planar, space.is_planar), (True, False))
        with self.assertRaisesRegex(tl.Error, "heights of its vehicles are unknown"):
            tl.audit(t, p[:, :, :2], limit={"height": 120})

    def test_layout_gives_the_order_of_axes(self) -> None:
        t, p = passing()
        expected = tl.audit(t, p, delta=0.5).to_dict()
        for layout, order in (("time,axis,vehicle", (0, 2, 1)), ("axis,vehicle,time", (2, 1, 0))):
            self.assertEqual(tl.audit(t, p.transpose(order), delta=0.5, layout=layout).to_dict(), expected, layout)
        with self.assertRaisesRegex(tl.Error, "time, vehicle and axis"):
            tl.audit(t, p, delta=0.5, layout="t,v,x")

    def test_a_gap_is_never_clear(self) -> None:
        t, p = passing()
        p[40:60, 2] = np.nan
        a = tl.audit(t, p, delta=0.1)
        self.assertEqual(a.verdict, "UNDECIDED")
        self.assertEqual([gap.vehicle for gap in a.gaps], ["3"])
        self.assertEqual([(fact.fact, fact.value) for fact in a.assumptions], [("motion", "straight")])
        with self.assertRaises(tl.ViolationError):
            a.raise_for_violation()
        a.raise_for_violation(allow_undecided=True)

    def test_velocities_tighten_bounded_motion(self) -> None:
        t = np.arange(30) * 0.5
        angle = 0.3 * t
        circle = np.stack([np.cos(angle), np.sin(angle), 0 * t], axis=1)
        p, v = np.zeros((30, 2, 3)), np.zeros((30, 2, 3))
        p[:, 0], p[:, 1] = 5 * circle, -5 * circle
        v[:, 0] = 1.5 * np.stack([-np.sin(angle), np.cos(angle), 0 * t], axis=1)
        v[:, 1] = -v[:, 0]
        without, sharp = (tl.audit(t, p, delta=1.0, velocities=x, motion="bounded", max_accel=0.6) for x in (None, v))
        self.assertGreater(sharp.separation_m, without.separation_m)
        self.assertLessEqual(sharp.separation_m, 10.0)

    def test_radii_obstacles_windows_limits_and_names(self) -> None:
        t, p = passing()
        self.assertEqual(tl.audit(t, p, radius={"1": 0.5, "2": 0.6, "3": 0.1, "4": 0.1}).violations[0].limit, 1.1)
        self.assertTrue(tl.audit(t, p, delta=1.5, until_s=1.0).is_clear)
        self.assertTrue(tl.audit(t, p, delta=1.5, ids=["3", "4"]).is_clear)
        named = tl.audit(t, p, delta=1.5, names=["a", "b,c", "d", "e"], ids=["b,c", "d"])
        self.assertEqual(named.to_dict()["judged"], 2)
        solid = self.folder / "solid.toml"
        place = "at_m = [9.0, 1.0, 0.0]\nclearance_m = 0.6\n"
        solid.write_text(f'[[obstacle]]\nname = "pole"\nball = {{ radius_m = 0.5 }}\n{place}')
        self.assertEqual(tl.audit(t, p, delta=0.1, obstacles=solid).violations[0].subjects, ("4", "pole"))
        solid.write_text(solid.read_text().replace("pole", "2"))
        self.assertEqual(tl.audit(t, p, delta=0.1, obstacles=solid).separation_m, 0.5)
        self.assertEqual(tl.audit(t, p, delta=0.1, limit={"speed": 0.1}).verdict, "VIOLATION")
        self.assertTrue(tl.audit(t, p, delta=0.1, limit={"speed": 5.0}).is_clear)

    def test_a_page_needs_an_unchanged_recording(self) -> None:
        t, p = passing()
        a = tl.audit(t, p, delta=1.5)
        page = self.folder / "a.html"
        a.to_html(page)
        self.assertIn("VIOLATION", page.read_text())
        p[0, 3] = 50.0
        self.refuses(tl.Error, "has changed", lambda: a.to_html(page))


class Files(Case):
    def test_the_folder_of_a_run_is_a_recording(self) -> None:
        tl.fly(short(), record=self.folder / "run.mcap")
        self.assertEqual(tl.audit(self.folder).to_dict(), tl.audit(self.folder / "run.mcap").to_dict())
        self.assertEqual(len(tl.read(self.folder).vehicles), 5)
        tl.export(self.folder, self.folder / "out.csv")
        self.assertTrue((self.folder / "out.csv").exists())

    def test_ids_may_be_an_iterator(self) -> None:
        t, p = passing()
        audit = tl.audit(t, p, delta=5.0, limit={"speed": 0.1}, ids=iter(["1", "2"]))
        self.assertEqual(audit.status, "violation")

    def test_an_audit_of_a_file_equals_that_of_the_command_line(self) -> None:
        file = self.folder / "run.mcap"
        tl.fly("pentagon-laplacian", record=file)
        a = tl.audit(file)
        self.assertEqual(a.to_dict(), printed_json(["audit", "--json", str(file)]))
        self.assertEqual(a.verdict, "VIOLATION")
        a.to_html(self.folder / "a.html")
        self.assertTrue((self.folder / "a.html").exists())

    def test_a_tautline_toml_beside_the_recording_is_used(self) -> None:
        t, p = passing()
        np.savez(self.folder / "p.npz", t=t, positions=p)
        (self.folder / "tautline.toml").write_text("[audit]\ndelta_m = 1.5\n")
        self.assertEqual(tl.audit(self.folder / "p.npz").verdict, "VIOLATION")
        self.assertTrue(tl.audit(self.folder / "p.npz", delta=0.1).is_clear)
        message = "neither delta nor its radius is given"
        self.refuses(tl.Error, message, lambda: tl.audit(self.folder / "p.npz", config=False))

    def test_a_path_of_a_fence_need_not_be_text(self) -> None:
        t, p = passing()
        fence = os.fsdecode(os.fsencode(self.folder) + b"/f\xe9.toml")
        with open(fence, "w") as file:
            file.write("[fence]\npolygon_m = [[-1, -1], [1, -1], [1, 1], [-1, 1]]\n")
        self.assertEqual(tl.audit(t, p, delta=0.1, fence=fence).status, "violation")

    def test_join_reads_files_with_one_vehicle_each(self) -> None:
        for name, x in (("a", 0.0), ("b", 1.0)):
            (self.folder / f"{name}.csv").write_text(f"t,x,y,z\n0,{x},0,0\n1,{x},0,0\n")
        files = [self.folder / "a.csv", self.folder / "b.csv"]
        self.assertEqual(tl.audit(files, delta=0.5, join=True).vehicles, ["a", "b"])
        self.refuses(tl.Error, "several recordings are given", lambda: tl.audit(files, delta=0.5))


class Shown(Case):
    def test_html_for_notebooks_has_no_script_and_escapes_names(self) -> None:
        t, p = passing()
        shown = tl.audit(t, p, delta=1.5, names=["<b>", "&", "c", "d"])._repr_html_()
        self.assertIn("VIOLATION", shown)
        self.assertIn("<svg", shown)
        self.assertIn("&lt;b&gt;", shown)
        for forbidden in ("<script", "http://", "https://", "<b>\"", "onload"):
            self.assertNotIn(forbidden, shown.replace("http://www.w3.org/2000/svg", ""))

    def test_findings_are_tables(self) -> None:
        t, p = passing()
        table = tl.audit(t, p, delta=1.5).violations.to_pandas()
        self.assertEqual(list(table.columns[:4]), ["first", "second", "from_s", "to_s"])
        self.assertEqual(table["first"].iloc[0], "1")


if __name__ == "__main__":
    import unittest

    unittest.main()
