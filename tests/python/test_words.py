"""Tests of messages in words of Python, and of the words that arguments take."""

import inspect
import re
import typing
import unittest

import tautline as tl
from shared import ROOT, Case, passing, short
from tautline import _arguments, _native, _words

#: Options of other programs, and of commands that the package does not have: pictures, films, replays, proofs.
FOREIGN = {
    "alarm", "bad", "film", "grid", "ink", "json", "law", "plot", "proof", "run", "shard", "share", "soft", "thing",
}  # fmt: skip
#: Crates whose messages reach Python.
CRATES = ("audit", "core", "laws", "recordings", "report", "shield", "sim", "studies", "validate")


def options_in_sources() -> set[str]:
    """Returns the options that messages of the library name."""
    found = set()
    for crate in CRATES:
        for file in (ROOT / "crates" / crate / "src").rglob("*.rs"):
            if file.name == "tests.rs" or "tests" in file.parts:
                continue
            lines = file.read_text(encoding="utf-8").splitlines()
            code = "\n".join(line for line in lines if not line.strip().startswith("//"))
            text = re.sub(r"`[^`]*`", "", code)
            found |= set(re.findall(r"(?<![\w-])--([a-z][a-z-]*[a-z])", text))
    return found


class Words(Case):
    def test_every_option_of_a_message_is_translated(self) -> None:
        options = options_in_sources()
        self.assertGreater(len(options), 60)
        for option in options - FOREIGN:
            with self.subTest(option=option):
                shown = _native.in_python(f"omit --{option}")
                self.assertNotIn("--", shown)
        for option in FOREIGN:
            self.assertIn("--", _native.in_python(f"omit --{option}"), option)

    def test_every_translation_is_an_argument(self) -> None:
        functions = (tl.audit, _arguments.read_options, tl.export, tl.compare, tl.margin, tl.sweep, tl.attack,
                     tl.campaign, tl.validate)  # fmt: skip
        arguments = {name for function in functions for name in inspect.signature(function).parameters} | {"join"}
        for option in options_in_sources() - FOREIGN:
            for code in (None, "export/window", "margin/range", "sweep/grid"):
                shown = _native.in_python(f"omit --{option}", code).removeprefix("omit ").partition("=")[0]
                self.assertIn(shown, arguments, (option, code))

    def test_values_are_those_of_python(self) -> None:
        for text, code, expected in (
            ("give --motion linear, or leave --motion out", None, 'give motion="linear", or leave motion out'),
            ("with --column id=NAME; else", None, 'with column={"id": "NAME"}; else'),
            ("--threads 4: must be 1", None, "threads=4: must be 1"),
            ("use --fps 30 (or --origin LAT,LON,HEIGHT)", None, "use fps=30 (or origin=[LAT, LON, HEIGHT])"),
            ("--limit accel=A and --start NAME=1,2,3", None, 'limit={"accel": A} and start={"NAME": [1, 2, 3]}'),
            ("--vary network.loss=0..0.3", None, 'vary={"network.loss": (0, 0.3)}'),
            ("overwrite it with --force", None, "overwrite it with overwrite=True"),
            ("--no-config ignores the file", None, "config=False ignores the file"),
            ("give a --to that is at least --from", None, "give a to_s that is at least from_s"),
            ("--from and --to", "margin/range", "start and stop"),
            ("--from 1 --to 1: equal", "margin/range", "start=1 stop=1: equal"),
            ("with --format csv, parquet", "export/unknown-format", 'with to="csv", parquet'),
            ("no effect with --to skyb", "export/unused-option", 'no effect with to="skyb"'),
            ("--key a --key b", "sweep/grid", 'keys="a" keys="b"'),
            ("run `tautline check --set x`", None, "run `tautline check --set x`"),
            ("a--to b, x --unknown y, and -- alone", None, "a--to b, x --unknown y, and -- alone"),
            ("Größe --delta", None, "Größe delta"),
            ("", None, ""),
        ):
            self.assertEqual(_native.in_python(text, code), expected)

    def test_no_message_names_an_option(self) -> None:
        t, p = passing()
        file, out = self.folder / "a.csv", self.folder / "b.csv"
        file.write_text("t,id,x,y,z\n0,1,0,0,0\n0,2,3,0,0\n1,1,0,0,0\n1,2,3,0,0\n")
        out.write_text("")
        for do in (
            lambda: tl.audit(t, p),
            lambda: tl.audit(t, p, delta=-1),
            lambda: tl.audit(t, p, delta=1, motion="bounded"),
            lambda: tl.audit(t, p, delta=1, ellipsoid=[1, 1, 2], radius=1),
            lambda: tl.audit(t, p, delta=1, tube=-1, plan=file),
            lambda: tl.audit(file, delta=1, max_gap=-1),
            lambda: tl.read(file, fps=-1),
            lambda: tl.read(file, scale=0),
            lambda: tl.export(file, out),
            lambda: tl.export(file, self.folder / "c.unknown"),
            lambda: tl.export(file, self.folder / "c.skyb", to="skyb"),
            lambda: tl.compare(short(), []),
            lambda: tl.compare(short(), ["orca", "orca"]),
            lambda: tl.compare(short(), runs=0),
            lambda: tl.compare(short(), runs=1, csv=out),
            lambda: tl.margin(short(), "time.duration_s", 1, 2, scan=1),
            lambda: tl.margin(short(), "time.duration_s", 1, 1),
            lambda: tl.margin(short(), "time.duration_s", -1, 1, log=True),
            lambda: tl.sweep(short(), {}),
            lambda: tl.sweep(short(), {"law.alpha": [1, 1]}),
            lambda: tl.sweep(short(), {"law.alpha": []}),
            lambda: tl.VectorSimulation("pentagon", 1, seeds=[75], set={"start.jitter_m": 0.6}),
            lambda: tl.sweep(short(), {"start.seed": [0.5]}),
            lambda: tl.attack(short()),
            lambda: tl.attack(short(), start=0.1, flights=0),
            lambda: tl.attack(short(), start=-1),
            lambda: tl.attack(short(), vary={"law.alpha": (2, 1)}),
            lambda: tl.validate(threads=0),
            lambda: tl.Scenario(set={"time.dt_s": "x"}),
        ):
            with self.subTest(line=do.__code__.co_firstlineno):
                with self.assertRaises((tl.Error, OSError)) as caught:
                    do()
                self.assertNotRegex(str(caught.exception), r"(?<![\w-])--[a-z]")
                self.assertNotRegex(str(caught.exception), "KEY=")

    def test_notes_name_no_option(self) -> None:
        file = self.folder / "a.csv"
        file.write_text("t,id,x,y,z\n0,1,0,0,0\n0,2,3,0,0\n1,1,0,0,0\n1,2,3,0,0\n")
        for notes in (tl.read(file).notes, tl.audit(file, delta=1).notes):
            self.assertIn('(confirm with time_unit="s")', " ".join(notes))
            self.assertNotIn("--", " ".join(notes))
        self.assertNotIn("--", tl.audit(file, delta=1).text)


class Choices(Case):
    def test_words_are_those_of_the_native_module(self) -> None:
        t, p = passing()
        file, output = self.folder / "a.csv", self.folder / "b.csv"
        for word, do in (
            ("Motion", lambda: tl.audit(t, p, delta=1, motion="x")),
            ("ReadFormat", lambda: tl.read(file, format="x")),
            ("TimeUnit", lambda: tl.read(file, time_unit="x")),
            ("Duplicates", lambda: tl.read(file, duplicates="x")),
            ("MessageClock", lambda: tl.read(file, clock="x")),
            ("ExportFormat", lambda: tl.export(file, output, to="x")),
            ("Verdict", lambda: tl.margin(short(), "time.duration_s", 1, 2, verdict="x")),
        ):
            with self.assertRaises(tl.Error) as caught:
                do()
            listed = re.search(r"\[possible values: (.*)\]", str(caught.exception))
            assert listed, caught.exception
            self.assertEqual(set(listed[1].split(", ")), set(typing.get_args(getattr(_words, word))), word)
        for rules in typing.get_args(_words.Rules):
            tl.audit(t, p, delta=1, rules=rules)
        for reaches in typing.get_args(_words.Reaches):

            class Law(tl.Law):
                def control(self, obs, out):
                    out[:] = 0.0

            Law.reaches = reaches
            tl.Simulation(short(), law=Law())

    def test_typed_dictionaries_hold_the_arguments(self) -> None:
        audit = inspect.signature(tl.audit).parameters
        self.assertEqual([*tl.AuditOptions.__annotations__], [name for name in audit][2:-1])
        self.assertEqual([*tl.ReadOptions.__annotations__], [*inspect.signature(_arguments.read_options).parameters])
        for name, annotation in tl.AuditOptions.__annotations__.items():
            self.assertEqual(getattr(annotation, "__forward_arg__", annotation), audit[name].annotation)
        with self.assertRaises(TypeError) as caught:
            tl.fly(short()).audit(detla=1)
        self.assertIn("audit() got an unexpected keyword argument 'detla'", str(caught.exception))
        with self.assertRaises(TypeError):
            tl.audit("a.csv", fromat="csv")

    def test_help_has_no_private_names(self) -> None:
        for name in tl.__all__:
            thing = getattr(tl, name)
            self.assertEqual(thing.__module__, "tautline", name)
            members = vars(thing).items() if inspect.isclass(thing) else ()
            for one in (thing, *(value for key, value in members if not key.startswith("_"))):
                text = inspect.getdoc(one) or ""
                if callable(one):
                    try:
                        text += str(inspect.signature(one))
                    except ValueError:
                        pass
                self.assertNotRegex(text, r"(?<![\w.])_[a-z]|_native|\._[a-z]", name)



if __name__ == "__main__":
    unittest.main()
