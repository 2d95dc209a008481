"""Tests of tables, attributes and indices: flat columns, in pandas and through Arrow."""

import subprocess
import sys
import unittest

import duckdb
import numpy as np
import pandas
import polars
import pyarrow
import pyarrow.parquet
import tautline as tl
from shared import Case, passing, short


class Producer:
    """An object that only exports a stream of Arrow, as other libraries see a table."""

    def __init__(self, table: tl.Table) -> None:
        self.table = table

    def __arrow_c_stream__(self, requested_schema=None):
        return self.table.__arrow_c_stream__(requested_schema)


def through_arrow(table: tl.Table) -> pyarrow.Table:
    """Returns a table that was read through the PyCapsule interface."""
    return pyarrow.table(Producer(table))


class Tables(Case):
    def test_integers_are_not_rounded_beside_unknown_values(self) -> None:
        big = 2**53 + 1
        for values in ([big, None], [2**63 + 1, None], [2**63 + 1]):
            rows = tl.Rows(tl.Row, [{"seed": value} for value in values])
            self.assertEqual(rows.to_pandas().seed.tolist()[0], values[0])
            self.assertEqual(int(rows.to_arrow()["seed"].to_pylist()[0]), values[0])

    def test_a_table_has_its_columns_and_types_without_rows(self) -> None:
        t, p = passing()
        p[20:40, 3] = np.nan
        full, clear = tl.audit(t, p, delta=1.5, limit={"speed": 0.1}), tl.audit(*passing(), delta=0.1)
        proved = tl.audit(*passing(), delta=0.1, motion="bounded", max_accel=0.1)
        for rows, none in (
            (full.violations, clear.violations),
            (full.closest, clear.undecided),
            (full.closest, clear.obstacles),
            (full.gaps, clear.gaps),
            (full.limits, clear.limits),
            (full.assumptions, proved.assumptions),
            (tl.fly("pentagon-laplacian").reasons, tl.fly("pentagon").reasons),
            (tl.fly("pentagon-laplacian").certificate.void, tl.fly("pentagon").certificate.void),
            (tl.check("pentagon-collinear").warnings, tl.check("pentagon").warnings),
        ):
            with self.subTest(table=repr(rows)[:60]):
                self.assertEqual((len(rows) > 0, len(none)), (True, 0))
                self.assertEqual(through_arrow(rows).schema, through_arrow(none).schema)
                self.assertEqual(rows.to_pandas().dtypes.to_dict(), none.to_pandas().dtypes.to_dict())
                self.assertEqual(set(rows[0]), set(type(rows[0])._kinds))
        dtypes = clear.violations.to_pandas().dtypes[["first", "lower", "first_index"]]
        self.assertEqual([str(dtype) for dtype in dtypes], ["string", "float64", "Int64"])

    def test_every_table_is_flat_in_pandas_and_arrow(self) -> None:
        t, p = passing()
        p[20:40, 3] = np.nan
        audit = tl.audit(t, p, delta=1.5, limit={"speed": 0.1})
        file, spec = self.folder / "run.mcap", self.folder / "spec.toml"
        flight = tl.fly(short(), record=file)
        spec.write_text('scenario = "pentagon"\nruns = 2\n[set]\ntime.duration_s = 1.0\n[vary]\nstart.seed = "run"\n'
                        '"start.jitter_m" = { uniform = [0.0, 0.1] }\n')  # fmt: skip
        answer = tl.compare(short(), ["laplacian", "edge-tension"], runs=2)
        tables = [
            (audit.violations, 1),
            (audit.closest, 6),
            (audit.gaps, 1),
            (audit.limits, 1),
            (audit.obstacles, 0),
            (answer.laws, 2),
            (answer.laws[0].flights, 2),
            (flight, 5 * len(flight.t)),
            (tl.read(file), 5 * len(flight.t)),
            (tl.campaign(spec, self.folder / "camp", worst=0), 2),
        ]
        for table, rows in tables:
            with self.subTest(table=repr(table)[:60]):
                frame, arrow = table.to_pandas(), through_arrow(table)
                self.assertEqual((len(frame), arrow.num_rows), (rows, rows))
                self.assertEqual(list(frame.columns), arrow.column_names)
                for column in arrow.columns:
                    kind = column.type
                    self.assertFalse(pyarrow.types.is_struct(kind) or pyarrow.types.is_map(kind), column)
                for name in frame.columns:
                    self.assertFalse(any(isinstance(cell, dict) for cell in frame[name]), name)

    def test_columns_hold_the_numbers(self) -> None:
        flight = tl.fly(short())
        arrow = through_arrow(flight)
        np.testing.assert_array_equal(arrow["vy"].to_numpy(), flight.velocities[:, :, 1].ravel())
        self.assertEqual(arrow["id"].to_pylist()[:6], [1, 2, 3, 4, 5, 1])
        self.assertEqual(arrow["index"].to_pylist()[:6], [0, 1, 2, 3, 4, 0])
        answer = tl.compare(short(), ["laplacian"], runs=2)
        row = through_arrow(answer.laws).to_pylist()[0]
        self.assertEqual(row["clear.of"], 2)
        self.assertEqual(row["min_median_m.value"], answer.laws[0].min_median_m.value)
        self.assertNotIn("flights", row)
        flown = through_arrow(answer.laws[0].flights).to_pylist()[0]
        self.assertEqual([flown["min_pair.first"], flown["min_pair.second"]], answer.laws[0].flights[0].min_pair)
        parquet = self.folder / "laws.parquet"
        pyarrow.parquet.write_table(answer.laws.to_arrow(), parquet)
        self.assertEqual(len(pandas.read_parquet(parquet)), 1)

    def test_a_column_of_several_types_is_text(self) -> None:
        from tautline._tables import to_arrow_column

        self.assertEqual(to_arrow_column([1, "a", None]).to_pylist(), ["1", "a", None])
        self.assertEqual(to_arrow_column([1, 2.5, None]).to_pylist(), [1.0, 2.5, None])

    def test_without_pyarrow_the_error_has_the_remedy(self) -> None:
        code = (
            "import sys; sys.modules['pyarrow'] = None\n"
            "import numpy as np, tautline as tl\n"
            "a = tl.audit(np.arange(3.0), np.arange(18.0).reshape(3, 2, 3), delta=1.0)\n"
            "assert len(a.closest.to_pandas()) == 1\n"
            "a.closest.to_arrow()\n"
        )
        ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
        self.assertIn("ImportError: tables of Arrow need pyarrow: pip install pyarrow", ran.stderr)


class Libraries(Case):
    def answers(self) -> dict[str, tuple[tl.Table, int]]:
        """Returns tables of all kinds, each with the number of its rows."""
        t, p = passing()
        p[20:40, 3] = np.nan
        audit, file = tl.audit(t, p, delta=1.5, limit={"speed": 0.1}), self.folder / "run.mcap"
        flight = tl.fly(short(), record=file)
        compared = tl.compare(short(), ["laplacian", "edge-tension"], runs=2)
        margin = tl.margin("pentagon", "time.duration_s", 2, 60, scan=2, halvings=1)
        sweep = tl.sweep(short(), {"law.alpha": [0.5, 1.0], "law.delta_m": [1, 9]})
        spec = {"scenario": "pentagon", "runs": 3, "set": {"time.duration_s": 2.0}}
        spec["vary"] = {"start.jitter_m": {"uniform": [0.0, 0.1]}}
        campaign = tl.campaign(spec, self.folder / "camp", worst=0)
        attack, check = tl.attack(short(), start=0.2, flights=3), tl.check("pentagon-collinear")
        found = {
            "audit": (audit, 9),
            "audit.closest": (audit.closest, 6),
            "audit.violations": (audit.violations, 1),
            "audit.undecided": (audit.undecided, 0),
            "audit.gaps": (audit.gaps, 1),
            "audit.facts": (audit.facts, 2),
            "flight": (flight, 5 * len(flight.t)),
            "flight.reasons": (flight.reasons, 1),
            "recording": (tl.read(file), 5 * len(flight.t)),
            "comparison": (compared, 2),
            "comparison.laws": (compared.laws, 2),
            "comparison.laws[0].flights": (compared.laws[0].flights, 2),
            "margin": (margin, 3),
            "margin.probes": (margin.probes, 3),
            "sweep": (sweep, 4),
            "sweep.points": (sweep.points, 4),
            "campaign": (campaign, 3),
            "campaign.laws": (campaign.laws, 1),
            "attack.bounds": (attack.bounds, 10),
            "attack.progress": (attack.progress, len(attack["progress"])),
            "check.warnings": (check.warnings, len(check["warnings"])),
            "check.margins": (check.margins, 2),
        }
        self.others = attack, check
        return found

    def test_polars_duckdb_pandas_and_pyarrow_read_the_same_cells(self) -> None:
        for name, (answer, rows) in self.answers().items():
            with self.subTest(table=name):
                arrow = pyarrow.table(answer)
                cells = arrow.to_pylist()
                frame, relation = polars.DataFrame(answer), duckdb.sql("from answer")
                self.assertEqual((len(cells), frame.height, len(answer.to_pandas())), (rows,) * 3)
                for columns in (frame.columns, relation.columns, list(answer.to_pandas().columns)):
                    self.assertEqual(columns, arrow.column_names)
                self.assertEqual(repr(frame.to_dicts()), repr(cells))
                # A relation reads the table again for each result.
                for _ in range(2):
                    self.assertEqual(repr(relation.fetchall()), repr([tuple(row.values()) for row in cells]))
                self.assertEqual(duckdb.sql("select count(*) from answer a, answer b").fetchall(), [(rows**2,)])
                self.assertEqual(duckdb.from_arrow(answer).shape, (rows, arrow.num_columns))
                self.assertEqual(polars.LazyFrame(frame).collect().shape, (rows, arrow.num_columns))
        for other in self.others:
            self.assertNotIsInstance(other, tl.Table)
            with self.assertRaises(TypeError):
                polars.DataFrame(other)
            with self.assertRaises(TypeError):
                pyarrow.table(other)
            with self.assertRaisesRegex(duckdb.InvalidInputException, "not suitable for replacement scans"):
                duckdb.sql("from other")

    def test_an_empty_table_has_the_columns_and_types_of_a_full_one(self) -> None:
        t, p = passing()
        full, clear = tl.audit(t, p, delta=1.5), tl.audit(t, p, delta=0.1)
        of_law = tl.compare(short(), ["laplacian"], runs=2).laws[0]
        for rows, none in (
            (full.violations, clear.violations),
            (full, tl.Rows(tl.Finding, [])),
            (of_law.flights, tl.Rows(type(of_law.flights[0]), [])),
            (tl.Rows(type(of_law), [of_law]), tl.Rows(type(of_law), [])),
            (tl.check("pentagon-collinear").warnings, tl.check("pentagon").warnings),
            (tl.check("pentagon").margins, tl.check("crazyflies").margins),
        ):
            with self.subTest(table=repr(rows)[:60]):
                few, many = polars.DataFrame(none).schema, polars.DataFrame(rows).schema
                self.assertEqual(list(few.items()), [item for item in many.items() if item[0] in few])
                self.assertEqual(len(few), len(many) - 2 * (rows is full))
                self.assertNotIn(polars.Null, many.values())
                types = dict(zip(duckdb.sql("from rows").columns, duckdb.sql("from rows").types, strict=True))
                empty = duckdb.sql("from none")
                self.assertEqual({name: types[name] for name in empty.columns},
                                 dict(zip(empty.columns, empty.types, strict=True)))  # fmt: skip
                self.assertEqual(empty.fetchall(), [])

    def test_an_audit_is_the_table_of_its_findings(self) -> None:
        audit = tl.audit(*passing(), delta=1.5, limit={"speed": 0.1})
        found = duckdb.sql("""select part, first, "second", lower from audit where finding = 'violation'""").fetchall()
        self.assertEqual([row[:3] for row in found], [("separation", "1", "2"), ("speed_m_s", "1", None)])
        self.assertEqual(found[0][3], audit.violations[0].lower)
        closest = polars.DataFrame(audit).filter(part="separation", finding="closest")
        self.assertEqual(closest["lower"].to_list(), [finding.lower for finding in audit.closest])

    def test_a_sweep_has_a_column_for_each_key(self) -> None:
        sweep = tl.sweep(short(), {"law.alpha": [0.5, 1.0], "law.delta_m": [1, 9]})
        found = duckdb.sql('select "law.alpha", "law.delta_m", refused from sweep').fetchall()
        self.assertEqual(found, [(0.5, 1.0, 0), (0.5, 9.0, 1), (1.0, 1.0, 0), (1.0, 9.0, 1)])

    def test_answers_and_rows_work_like_dictionaries_and_lists(self) -> None:
        answer = tl.compare(short(), ["laplacian", "edge-tension"], runs=1)
        plain = answer.to_dict()
        self.assertEqual((dict(answer), dict(answer.items()), {**answer}), (plain,) * 3)
        self.assertEqual((list(answer), list(answer.keys()), list(answer.values())),
                         (list(plain), list(plain), list(plain.values())))  # fmt: skip
        self.assertTrue("runs" in answer and "nope" not in answer and len(answer) == len(plain))
        self.assertEqual((answer.get("runs"), answer.get("nope"), answer.get("nope", 3)), (1, None, 3))
        self.assertTrue(answer == plain and answer != {} and answer != 3)
        laws = answer.laws
        self.assertEqual([law.name for law in reversed(laws)], ["edge-tension", "laplacian"])
        self.assertTrue(laws[0] in laws and 3 not in laws)
        self.assertEqual((laws.index(laws[1]), laws.count(laws[1])), (1, 1))
        self.assertRaises(ValueError, laws.index, 3)
        self.assertEqual((laws[:1], laws[-1].name), ([laws[0]], "edge-tension"))
        self.assertTrue(laws == list(laws) and laws == answer.laws and laws != list(laws)[:1])
        self.assertEqual(polars.DataFrame(list(laws)).height, 2)


class Attributes(Case):
    def test_keys_are_attributes_and_in_dir(self) -> None:
        answer = tl.compare(short(), ["laplacian"], runs=1)
        self.assertEqual(answer.laws[0].violated.share, answer["laws"][0]["violated"]["share"])
        self.assertEqual(answer.scenario.name, "pentagon")
        self.assertIn("laws", dir(answer))
        self.assertIn("violated", dir(answer.laws[0]))
        check = tl.check("pentagon")
        self.assertIn("certificate_void", dir(check))
        for thing in (answer, answer.laws[0], check):
            for name in dir(thing):
                if not name.startswith("_") and name != "pair":
                    getattr(thing, name)
            with self.assertRaises(AttributeError) as caught:
                thing.nope  # noqa: B018
            self.assertNotIn("nope", dir(thing))
        self.assertIn("nope", str(caught.exception))

    def test_findings_have_indices_beside_names(self) -> None:
        t, p = passing()
        p[20:40, 3] = np.nan
        names = ["w", "x", "y", "z"]
        audit = tl.audit(t, p, delta=1.5, names=names)
        for finding in audit.closest:
            self.assertEqual(finding.subjects, tuple(names[index] for index in finding.indices))
            self.assertEqual(finding.pair, finding.subjects)
        self.assertEqual(audit.violations[0].indices, (0, 1))
        self.assertEqual(audit.gaps[0].indices, (3,))
        frame = audit.violations.to_pandas()
        self.assertEqual(frame[["first", "first_index", "second", "second_index"]].values.tolist(), [["w", 0, "x", 1]])
        self.assertEqual(audit.gaps.to_pandas()["vehicle_index"].tolist(), [3])
        near = tl.fly("obstacles", set={"time.duration_s": 2.0}).audit().obstacles
        self.assertTrue(all(finding.indices[1] is None and finding.indices[0] is not None for finding in near))
        sim = tl.Simulation(short())
        sim.step(steps=10)
        first, second = sim.closest.indices
        self.assertEqual(sim.closest.subjects, (str(first + 1), str(second + 1)))


class ArrayTensor:
    """An array of another library with `__array__`, which may refuse."""

    def __init__(self, array: np.ndarray, error: Exception | None = None) -> None:
        self.array, self.error = array, error

    def __array__(self, dtype=None, copy=None):
        if self.error:
            raise self.error
        return self.array


class DlpackTensor:
    """An array of another library with DLPack alone."""

    def __init__(self, array: np.ndarray) -> None:
        self.array = array

    def __dlpack__(self, **options):
        return self.array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self.array.__dlpack_device__()


class Exact(Case):
    def test_exact_numbers_of_any_origin_give_the_same_audit(self) -> None:
        t, p = passing()
        p = np.round(p * 64) / 64  # Exact in half precision.
        expected = tl.audit(t, p, delta=1.5).to_dict()
        for positions in (
            p.astype(np.float32),
            p.astype(np.float16),
            p.astype(">f8"),
            p.tolist(),
            np.asfortranarray(p),
            ArrayTensor(p.astype(np.float32)),
            DlpackTensor(p),
        ):
            self.assertEqual(tl.audit(t, positions, delta=1.5).to_dict(), expected)
        self.assertEqual(tl.audit(t.tolist(), p, delta=1.5).to_dict(), expected)
        whole = np.round(p * 10)
        self.assertEqual(
            tl.audit(t, whole.astype(np.int32), delta=1.5).to_dict(), tl.audit(t, whole, delta=1.5).to_dict()
        )

    def test_single_precision_is_widened_exactly(self) -> None:
        t, p = passing()
        single = (p * 1.1).astype(np.float32)
        found = tl.audit(t, single, delta=1.5)
        self.assertEqual(found.to_dict(), tl.audit(t, single.astype(np.float64), delta=1.5).to_dict())
        self.assertNotEqual(found.separation_m, tl.audit(t, p * 1.1, delta=1.5).separation_m)

    def test_inexact_numbers_are_refused(self) -> None:
        t, p = passing()
        large = np.full(p.shape, 2**53 + 1)
        self.refuses(tl.Error, "positions: an integer is larger than 2^53", lambda: tl.audit(t, large, delta=1.0))
        for message, positions in (
            ("not complex128", p + 0j),
            ("not bool", p > 1),
            ("not object", p.astype(object)),
            ("Can't call numpy() on Tensor that requires grad", ArrayTensor(p, RuntimeError(
                "Can't call numpy() on Tensor that requires grad. Use tensor.detach().numpy() instead."))),
            ("can't convert cuda:0 device type tensor", ArrayTensor(p, TypeError(
                "can't convert cuda:0 device type tensor to numpy. Use Tensor.cpu() first."))),
        ):  # fmt: skip
            self.refuses(TypeError, "positions: ", lambda p=positions: tl.audit(t, p, delta=1.0))
            self.refuses(TypeError, message, lambda p=positions: tl.audit(t, p, delta=1.0))
        if np.dtype(np.longdouble).itemsize > 8:
            self.refuses(TypeError, "at most 64 bits", lambda: tl.audit(t, p.astype(np.longdouble), delta=1.0))
        self.refuses(tl.Error, "give rows of equal length", lambda: tl.audit(t, [[[0.0, 1.0], [0.0]]], delta=1.0))

    def test_simulations_take_them_too(self) -> None:
        u = np.full((5, 3), 0.1, dtype=np.float32)
        sims = [tl.Simulation(short()) for _ in range(4)]
        for sim, commands in zip(sims, (u, u.astype(float), u.tolist(), DlpackTensor(u)), strict=True):
            sim.step(commands, steps=20)
        for sim in sims[1:]:
            np.testing.assert_array_equal(sim.positions, sims[0].positions)

    def test_out_takes_tensors(self) -> None:
        class Policy(tl.Law):
            def control(self, obs, out):
                out[:] = ArrayTensor(np.zeros((5, 3), dtype=np.float32))

        self.assertIsNone(tl.fly(short(), law=Policy()).ended_early)


if __name__ == "__main__":
    unittest.main()
