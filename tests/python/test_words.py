"""Tests of messages in words of Python, and of the words that arguments take."""

import inspect
import re
import typing
import unittest

import tautline as tl
from shared import ROOT, Case, passing, short
from tautline import _arguments, _audit, _native, _words

#: Options of commands that the package does not have: watches, pictures, films, replays, proofs, logs of contracts.
FOREIGN = {
    "accel", "adapter", "bad", "brake", "contract_log", "expect", "film", "film_fps", "horizon", "identify", "json",
    "latency", "max_age", "max_vehicles", "position_error", "proof", "run", "shard", "size", "velocity_error",
}  # fmt: skip


def options() -> set[str]:
    """Returns the arguments of the table of options."""
    table = (ROOT / "crates" / "core" / "src" / "option.rs").read_text(encoding="utf-8")
    return set(re.findall(r'^    [A-Z_]+ = "[a-z0-9-]+" "([a-z0-9_]+)" \w+;$', table, re.MULTILINE))


class Words(Case):
    def test_every_option_is_an_argument(self) -> None:
        functions = (tl.audit, _arguments.read_options, tl.export, tl.compare, tl.margin, tl.sweep, tl.attack,
                     tl.campaign, tl.validate)  # fmt: skip
        arguments = {name for function in functions for name in inspect.signature(function).parameters} | {"join"}
        self.assertGreater(len(options()), 60)
        self.assertEqual(options() - arguments, FOREIGN)

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
        named = [*tl.AuditOptions.__annotations__]
        self.assertEqual(named, [*inspect.signature(tl.audit).parameters][2:-1])
        self.assertEqual({*named} - {*_audit.CHECKS}, {"velocities", "names"})
        self.assertEqual({*_audit.CHECKS} - {*named}, set())
        self.assertEqual([name for name in named if f"``{name}``" not in str(tl.audit.__doc__)], [])
        self.assertEqual([*tl.ReadOptions.__annotations__], [*inspect.signature(_arguments.read_options).parameters])
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
