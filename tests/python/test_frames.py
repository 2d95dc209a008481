"""Tests of audits of data frames: pandas, polars, pyarrow and DuckDB."""

import gc
import glob
import json
import pickle
import subprocess
import sys
import tempfile
from decimal import Decimal
from pathlib import Path

import duckdb
import numpy as np
import pandas
import polars
import pyarrow
import pyarrow.parquet
import tautline as tl
from shared import Case, passing

NAMES = ["cf1", "cf2", "cf3", "cf4"]
#: Keys of a report that name the source and what its reader found in it.
SOURCE = ("recording", "notes", "facts", "clock")


def flight() -> tuple[np.ndarray, np.ndarray]:
    """Returns times and positions of a flight with a violation, in which vehicle 4 is not seen for two seconds."""
    _, p = passing()
    p[20:40, 3] = np.nan
    return np.arange(len(p)) / 8, p


def long(t: np.ndarray | pandas.Series | None = None) -> pandas.DataFrame:
    """Returns the flight as a table with a row for each vehicle and time."""
    seconds, p = flight()
    axes = {axis: p[:, :, k].ravel() for k, axis in enumerate("xyz")}
    return pandas.DataFrame({"t": np.repeat(seconds if t is None else t, 4), "id": NAMES * len(p), **axes})


def wide() -> pandas.DataFrame:
    """Returns the flight as a table with a row for each time."""
    t, p = flight()
    axes = {f"{name}.{axis}": p[:, i, k] for i, name in enumerate(NAMES) for k, axis in enumerate("xyz")}
    return pandas.DataFrame({"t": t, **axes})


def without_source(audit: tl.Audit) -> dict:
    """Returns a report without its source."""
    return {key: value for key, value in audit.to_dict().items() if key not in SOURCE}


def stored() -> list[str]:
    """Returns the temporary files of tables."""
    return glob.glob(f"{glob.escape(tempfile.gettempdir())}/tautline-*/table.parquet")


class Frames(Case):
    def test_a_table_of_any_library_has_the_report_of_its_arrays_and_of_its_file(self) -> None:
        frame, table = long(), pyarrow.Table.from_pandas(long(), preserve_index=False)
        frame_wide = wide()
        arrays = tl.audit(*flight(), names=NAMES, delta=1.5)
        self.assertEqual((arrays.verdict, len(arrays.gaps)), ("VIOLATION", 1))
        pyarrow.parquet.write_table(table, self.folder / "long.parquet")
        file = tl.audit(self.folder / "long.parquet", delta=1.5)
        pivoted = frame.pivot(index="t", columns="id", values=["x", "y", "z"])
        category = frame.astype({"id": "category"})
        of_polars = polars.from_pandas(frame)
        for name, given in (
            ("pandas", frame),
            ("filtered", pandas.concat([frame, frame]).iloc[: len(frame)].set_axis(range(7, len(frame) + 7))),
            ("index", frame.set_index("t")),
            ("index and column", frame.set_index("t", drop=False)),
            ("two levels", frame.set_index(["t", "id"])),
            ("categories", category),
            ("nullable", frame.convert_dtypes()),
            ("pandas with Arrow", frame.convert_dtypes(dtype_backend="pyarrow")),
            ("wide", frame_wide),
            ("wide, axis first", pivoted),
            ("wide, name first", pivoted.swaplevel(axis=1)),
            ("wide, categories", category.pivot(index="t", columns="id", values=["x", "y", "z"])),
            ("polars", of_polars),
            ("polars, NaN", of_polars.with_columns(polars.col("x", "y", "z").fill_null(float("nan")))),
            ("polars, categories", of_polars.with_columns(polars.col("id").cast(polars.Categorical))),
            ("polars, wide", polars.from_pandas(frame_wide)),
            ("pyarrow", table),
            ("batch", table.combine_chunks().to_batches()[0]),
            ("duckdb", duckdb.sql("from frame")),
            ("duckdb, wide", duckdb.sql("from frame_wide order by t")),
        ):
            with self.subTest(table=name):
                audit = tl.audit(given, delta=1.5)
                self.assertEqual((audit["recording"], audit["clock"]["unit"]), ("table", "s"))
                self.assertEqual(without_source(audit), without_source(arrays))
                if "wide" not in name:
                    self.assertEqual({**audit.to_dict(), "recording": str(file["recording"])}, file.to_dict())
                self.assertEqual(tl.audit(given, delta=1.5).to_dict(), audit.to_dict())
                self.assertIn("at 12.38 s", audit.headline)

    def test_times_are_dates_or_durations_of_any_unit(self) -> None:
        t, p = flight()
        elapsed = np.round(t * 1000).astype("timedelta64[ms]")
        expected = without_source(tl.audit(t, p, names=NAMES, delta=1.5))
        zone = pandas.Series(np.datetime64("2024-03-31T00:59:55") + elapsed).dt.tz_localize("UTC")
        for times in (
            elapsed,
            elapsed.astype("timedelta64[ns]"),
            np.datetime64("2024-03-31T00:59:55") + elapsed,
            np.datetime64("2024-03-31T00:59:55") + elapsed.astype("timedelta64[us]"),
            zone.dt.tz_convert("Europe/Berlin"),
        ):
            frame = long(times)
            by_time = frame.set_index("t")
            for given in (
                frame,
                by_time,
                by_time.rename_axis(None),
                polars.from_pandas(frame),
                pyarrow.Table.from_pandas(frame),
            ):
                with self.subTest(table=type(given).__name__, times=str(frame.t.dtype)):
                    self.assertEqual(without_source(tl.audit(given, delta=1.5)), expected)
            # Times beside arrays.
            column = frame.t[::4].reset_index(drop=True)
            for given in (column, pandas.Index(column), polars.Series(column), pyarrow.array(column), np.array(times)):
                if getattr(given, "dtype", None) != object:
                    with self.subTest(times=f"{type(given).__name__} {column.dtype}"):
                        self.assertEqual(without_source(tl.audit(given, p, names=NAMES, delta=1.5)), expected)

    def test_times_without_a_fixed_or_exact_length_are_refused(self) -> None:
        p = np.zeros((2, 2, 3))
        p[:, 1] = 3.0
        for message, times in (
            ("has no fixed length", np.array(["2024", "2025"], dtype="datetime64[Y]")),
            ("has no fixed length", np.array([1, 2], dtype="timedelta64[M]")),
            ("a time is unknown (NaT)", np.array(["2024-01-01", "NaT"], dtype="datetime64[s]")),
            ("a time is unknown (NaT)", polars.Series([None, 1]).cast(polars.Datetime)),
            ("a time is unknown (NaT)", pyarrow.array([None, 1], pyarrow.duration("ns"))),
            ("counts beyond 2^53", np.array([0, 2**53 + 2], dtype="timedelta64[ns]")),
        ):
            self.refuses(tl.Error, message, lambda times=times: tl.audit(times, p, delta=1.0))

    def test_options_of_reading_apply(self) -> None:
        frame = long().rename(columns={"x": "east", "id": "drone"})
        found = tl.audit(frame, column={"x": "east", "id": "drone"}, time_unit="ms", delta=1.5)
        self.assertEqual((found["clock"], found.vehicles), ({"unit": "ms", "inferred": False, "epoch_ns": 0}, NAMES))
        backwards = long().iloc[::-1]
        self.refuses(tl.Error, "sort=True", lambda: tl.audit(backwards, delta=1.5))
        self.assertEqual(tl.audit(backwards, delta=1.5, sort=True).status, "violation")

    def test_a_tautline_toml_beside_the_temporary_file_is_not_read(self) -> None:
        code = (
            "import pandas, tautline as tl\n"
            "frame = pandas.DataFrame({'t': [0, 0, 1, 1], 'id': [1, 2, 1, 2], 'x': [0, 5, 0, 5], 'y': 0.0, 'z': 0.0})\n"
            "tl.audit(frame)\n"
        )
        (self.folder / "tautline.toml").write_text("[audit]\ndelta_m = 1.5\n")
        environment = {"TMPDIR": str(self.folder)}
        ran = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
        self.assertIn("neither delta nor its radius is given", ran.stderr)
        self.assertEqual([file.name for file in self.folder.iterdir()], ["tautline.toml"])


class WrongFrames(Case):
    def test_a_wrong_table_is_an_error_with_a_remedy_and_without_a_temporary_path(self) -> None:
        frame, decimals = long(), [Decimal(1)] * len(long())
        far = frame.x.astype(object).where(frame.x > 1, "far")
        dates = long(np.datetime64("2024-03-31T00:59:55") + np.arange(100).astype("timedelta64[s]"))
        first = frame.index == 0
        for message, given in (
            ("no column gives time", frame.drop(columns="t")),
            ("no column gives time", pandas.DataFrame()),
            ("no rows", frame.head(0)),
            ("no rows", polars.from_pandas(frame).head(0)),
            ("two columns have the name 'x'; rename one", pandas.concat([frame, frame.x], axis=1)),
            ("two columns have the name '1'; rename one", frame.rename(columns={"x": 1, "y": "1"})),
            ("column 'x' holds values of several kinds", frame.assign(x=far)),
            ("column 'x' holds values of several kinds", frame.assign(x=frame.x + 1j)),
            ("column 'w' has the type", frame.assign(w=pandas.period_range("2024", periods=len(frame), freq="D"))),
            ("no column gives the position along x", frame.assign(x=[[0.0, 1.0]] * len(frame))),
            ("column `x` holds decimals (save numbers as double", frame.assign(x=decimals)),
            ("decimals", duckdb.sql("select t::DECIMAL(9, 3) as t, id, x, y, z from frame")),
            ("row 1: column `t` is empty", dates.assign(t=dates.t.where(~first))),
            ("row 1: column `t` is empty", frame.assign(t=frame.t.where(~first))),
            ("row 6: column `y` is empty", frame.assign(y=frame.y.where(frame.index != 5))),
            ("row 6: column `y` holds `inf`", frame.assign(y=frame.y.where(frame.index != 5, np.inf))),
            ("column `x` holds neither numbers", frame.assign(x=frame.x > 1)),
            ("second row at 0 s", frame.assign(id="cf1")),
            ("an integer is larger than 2^53", frame.assign(x=np.full(len(frame), 2**63, dtype=np.uint64))),
        ):
            with self.subTest(message=message):
                self.refuses(tl.Error, message, lambda given=given: tl.audit(given, delta=1.5))
                try:
                    tl.audit(given, delta=1.5)
                except tl.Error as error:
                    self.assertNotIn(tempfile.gettempdir(), str(error))
                    self.assertNotIn("tautline-", str(error))
                    self.assertRegex(str(error), r"^(table|t\b)")
        self.assertEqual(stored(), [])

    def test_other_objects_are_a_type_error(self) -> None:
        frame, flown = long(), tl.fly("pentagon", set={"time.duration_s": 1.0})
        for message, given in (
            ("a Series has a single column", frame.x),
            ("a Series has a single column", polars.Series([1.0])),
            ("a ChunkedArray has a single column", pyarrow.chunked_array([[1.0]])),
            ("not type", pandas.DataFrame),
            ("not LazyFrame", polars.from_pandas(frame).lazy()),
            ("not dict", {"t": [0.0]}),
            ("a Flight has an audit of its own", flown),
        ):
            self.refuses(TypeError, message, lambda given=given: tl.audit(given, delta=1.5))
        self.refuses(TypeError, "only for arrays", lambda: tl.audit(frame, delta=1.5, names=NAMES))

    def test_without_pyarrow_the_error_has_the_remedy(self) -> None:
        code = (
            "import polars, sys, tautline as tl\n"
            "sys.modules['pyarrow'] = None\n"
            "tl.audit(polars.DataFrame({'t': [0.0], 'id': [1], 'x': [0.0], 'y': [0.0]}), delta=1.0)\n"
        )
        ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
        self.assertIn("ImportError: tables of Arrow need pyarrow: pip install pyarrow", ran.stderr)


class Lifetime(Case):
    def test_the_temporary_file_exists_as_long_as_the_audit_and_has_no_name_in_it(self) -> None:
        gc.collect()
        self.assertEqual(stored(), [])
        audit = tl.audit(long(), delta=1.5)
        (file,) = stored()
        self.assertEqual(Path(file).parent.stat().st_mode & 0o077, 0)
        audit.to_html(self.folder / "a.html")
        page = (self.folder / "a.html").read_text()
        self.assertIn("tautline.audit(table, delta=1.5)", page)
        for text in (page, json.dumps(audit.to_dict()), str(audit), repr(audit), audit._repr_html_()):
            self.assertNotIn(Path(file).parent.name, text)
        del audit
        gc.collect()
        self.assertEqual(stored(), [])

    def test_a_process_removes_its_file_and_a_copy_of_the_process_keeps_it(self) -> None:
        code = (
            "import multiprocessing, os, sys, time\n"
            "import pandas, tautline as tl\n"
            "frame = pandas.DataFrame({'t': [0, 0, 1, 1], 'id': [1, 2, 1, 2], 'x': [0, 5, 0, 5], 'y': 0.0, 'z': 0.0})\n"
            "audit = tl.audit(frame, delta=1.0, time_unit='s')\n"
            "copy = os.fork()\n"
            "if copy == 0:\n"
            "    sys.exit(0)\n"
            "os.waitpid(copy, 0)\n"
            "audit.to_html('page.html')\n"
        )
        environment, folder = {"TMPDIR": str(self.folder)}, self.folder / "work"
        folder.mkdir()
        command = [sys.executable, "-c", code]
        ran = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
        self.assertEqual((ran.returncode, ran.stderr), (0, ""))
        self.assertEqual([file.name for file in self.folder.iterdir()], ["work"])

    def test_an_audit_of_a_table_can_be_pickled(self) -> None:
        audit = tl.audit(long(), delta=1.5)
        again = pickle.loads(pickle.dumps(audit))
        self.assertEqual((again.verdict, again.to_dict()), (audit.verdict, audit.to_dict()))
        self.refuses(tl.Error, "has no recording", lambda: again.to_html(self.folder / "a.html"))


class Reviewed(Case):
    """Tables that were read in a wrong way."""

    def test_vehicles_with_names_of_axes_are_refused_or_read_by_their_level(self) -> None:
        frame = long()
        names = dict(zip(sorted(set(frame["id"])), "xyzw", strict=True))
        frame["id"] = [names[vehicle] for vehicle in frame["id"]]
        expected = tl.audit(frame, delta=1.5)
        axis_first = frame.pivot(index="t", columns="id", values=["x", "y", "z"])
        for table in (axis_first, axis_first.swaplevel(axis=1)):
            found = tl.audit(table, delta=1.5)
            self.assertEqual((found.verdict, found.separation_m), (expected.verdict, expected.separation_m))
        only_axes = frame[frame["id"] != "w"].pivot(index="t", columns="id", values=["x", "y", "z"])
        self.refuses(tl.Error, "both levels of the columns are axes", lambda: tl.audit(only_axes, delta=1.5))

    def test_the_only_vehicle_of_a_table_has_a_name_that_stays(self) -> None:
        frame = pandas.DataFrame({"t": [0.0, 1.0], "x": [0.0, 1.0], "y": 0.0, "z": 0.0})
        one, other = (tl.audit(frame, limit={"speed": 5}) for _ in range(2))
        self.assertEqual((one.vehicles, one.to_dict()), (["table"], other.to_dict()))

    def test_integers_that_would_be_rounded_are_refused(self) -> None:
        whole = [2**53 + 1, 2**53 + 3]
        table = {"t": [0, 0, 1, 1], "id": ["a", "b"] * 2, "y": [0.0] * 4, "z": [0.0] * 4}
        message = "integer"
        for kind in (pyarrow.int64(), pyarrow.uint64()):
            frame = pyarrow.table({**table, "x": pyarrow.array(whole * 2, kind)})
            self.refuses(tl.Error, message, lambda frame=frame: tl.audit(frame, delta=3.0, time_unit="s"))
            file = self.folder / "large.parquet"
            pyarrow.parquet.write_table(frame, file)
            self.refuses(tl.Error, "that would be rounded", lambda file=file: tl.audit(file, delta=3.0, time_unit="s"))
        even = pyarrow.table({**table, "x": pyarrow.array([2**53 + 2, 2**53 + 8] * 2, pyarrow.int64())})
        self.assertEqual(tl.audit(even, delta=3.0, time_unit="s").separation_m, 6.0)
        positions = np.zeros((5, 2, 3), dtype=np.int64)
        positions[:, :, 0] = whole
        np.savez(self.folder / "large.npz", t=np.arange(5.0), positions=positions)
        self.refuses(tl.Error, "which would be rounded", lambda: tl.audit(
            self.folder / "large.npz", delta=3.0, layout="time,vehicle,axis"))  # fmt: skip

    def test_times_that_wrap_are_refused(self) -> None:
        t = np.array([2**63 - 1000, -(2**63) + 1000], dtype="datetime64[ns]")
        self.refuses(tl.Error, "counts beyond 2^53", lambda: tl.audit(t, np.zeros((2, 2, 3)), delta=1.0))
        self.refuses(TypeError, "join: only for files", lambda: tl.audit(long(), delta=1.5, join=True))


if __name__ == "__main__":
    import unittest

    unittest.main()
