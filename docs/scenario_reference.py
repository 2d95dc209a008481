"""Generates docs/scenario.md from the schema of the program:

    tautline schema | python3 docs/scenario_reference.py > docs/scenario.md

The text below the keys of a table NAME is docs/scenario/NAME.md, if that file exists.
"""

from __future__ import annotations

import json
import re
import sys
import textwrap
from pathlib import Path
from typing import Any, Iterator

Schema = dict[str, Any]

NOTES = Path(__file__).resolve().parent / "scenario"

HEAD = """\
# Scenario reference

Which keys does a scenario have? `tautline list --show pentagon` prints a file to start from;
[ten-minutes.md](ten-minutes.md) explains one. An editor with the JSON Schema of `tautline schema` completes and checks
keys as you type. `--set time.duration_s=20`, `--set 'start={shape="grid", spacing_m=2}'` or
`--set start.positions_m.4.x=-1` sets a key for one run; lists count from 1.

| column | meaning |
| --- | --- |
| type | type and range: `> 0` is a number above 0, a vector has 2 or 3 numbers. Further conditions are checked |
| default | value without the key; `needed`: the key is required; `-`: no value, or as in the last column |

Units are at the ends of keys: `_m`, `_s`, `_m_s`, `_m_s2`, `_per_s`, `_per_s2`, `_deg`, `_rad_s`, `_hz`, `_kg`, `_n`;
others are in brackets. A row in bold begins the keys of one value, or of a subtable.
"""

# Order of the tables on the page; other tables of the schema come last.
ORDER = (
    "name swarm start formation leg law laws graph reference deadlock arrival obstacle safety vehicle wind sensing "
    "network actuation failure noise time plant"
).split()

# Suffixes of keys and their units, longest first.
UNITS = {
    "_n_per_rpm2": "N/rpm^2", "_n_per_rpm": "N/rpm", "_n_s2_m2": "N s^2/m^2", "_m4_per_s2": "m^4/s^2",
    "_s_per_m2": "s/m^2", "_n_s_m": "N s/m", "_per_s2": "1/s^2", "_kg_m2": "kg m^2", "_per_s": "1/s", "_m_s2": "m/s^2",
    "_rad_s": "rad/s", "_m_s": "m/s", "_deg": "degrees", "_hz": "Hz", "_kg": "kg", "_m": "m", "_s": "s", "_n": "N",
}  # fmt: skip
UNNAMED = {"alpha": "m^2/s^2"}
# Units that the page gives beside the key.
BESIDE = {"m^2/s^2", "N/rpm^2", "N/rpm", "N s^2/m^2", "m^4/s^2", "s/m^2", "N s/m", "kg m^2"}

COLUMNS = "| key | type | default | meaning |\n| --- | --- | --- | --- |"
# Meanings of more words are given once in a table.
LONG = 4


class Reference:
    """The page for a schema."""

    def __init__(self, schema: Schema) -> None:
        self.schema = schema
        self.definitions: dict[str, Schema] = schema["$defs"]

    def page(self) -> str:
        keys: dict[str, Schema] = self.schema["properties"]
        names = [name for name in ORDER if name in keys] + [name for name in keys if name not in ORDER]
        tables = [name for name in names if self.is_table(keys[name]) and not keys[name].get("deprecated")]
        plain = {name: keys[name] for name in names if name not in tables}
        required = self.schema["required"]
        parts = [HEAD, "## The file\n", self.rows(plain, required), ""]
        links = [f"[`[{name}]`](#{name})" for name in required]
        parts.append(f"Required tables: {listed(links, 'and')}.\nAll others are optional.\n")
        for name in tables:
            parts.extend(self.section(name, keys[name], 2))
        return "\n".join(wrapped("\n".join(parts)))

    def section(self, path: str, use: Schema, level: int) -> Iterator[str]:
        """Yields the section of a table, then those of its subtables."""
        table = self.followed(use)
        several = table.get("type") == "array"
        table = self.followed(table["items"]) if several else table
        table, both = self.one_of_several(table)
        yield f"{'#' * level} {self.heading(path, several)}\n"
        used, own = sentence(use.get("description", "")), sentence(table.get("description", ""))
        # A key that is also text has its description in the table of keys.
        about = own if own and not self.is_subtable(use) else max(used, own, key=len)
        yield about + (" Give a `[[table]]` for each, or a list." if both else "") + "\n"
        values = table.get("additionalProperties")
        if isinstance(values, dict):
            table = self.followed(values)
        yield from self.keys(path, table, level)

    def keys(self, path: str, table: Schema, level: int) -> Iterator[str]:
        keys: dict[str, Schema] = table.get("properties", {})
        variants = self.variants(table)
        elsewhere = self.same(path, keys, variants)
        own = {
            name: key
            for name, key in keys.items()
            if not self.is_subtable(key) and not (elsewhere and name in elsewhere[1])
        }
        short = {name: key for name, key in keys.items() if self.is_short(f"{path}.{name}", key)}
        rows = [self.row(name, key, name in table.get("required", [])) for name, key in own.items()]
        if variants and not elsewhere:
            rows += self.varied(variants)
        for name, key in short.items():
            rows += self.inlined(f"{path}.{name}", key)
        if rows:
            yield "\n".join([COLUMNS, *rows]) + "\n"
        if elsewhere:
            yield self.referred(*elsewhere, self.tag(variants[0]), bool(own))
        if (notes := NOTES / f"{path}.md").exists():
            yield notes.read_text(encoding="utf-8")
        for name, key in keys.items():
            if self.is_table(key) and name not in short:
                yield from self.section(f"{path}.{name}", key, min(level + 1, 3))

    def is_short(self, path: str, key: Schema) -> bool:
        """Returns whether the keys of a subtable are rows of the table above it: plain keys without notes."""
        if not self.is_subtable(key) or (NOTES / f"{path}.md").exists():
            return False
        table = self.entries(key)
        keys = table.get("properties", {}).values()
        return bool(keys) and not self.variants(table) and not any(map(self.is_table, keys))

    def inlined(self, path: str, key: Schema) -> list[str]:
        """Returns the rows of a subtable."""
        table = self.entries(key)
        several = self.followed(key).get("type") == "array"
        about = cell(max(key.get("description", ""), table.get("description", ""), key=len))
        rows = [f"| **`{self.heading(path, several).strip('`')}`** | | | {about} |"]
        needed = table.get("required", [])
        return rows + [self.row(name, one, name in needed) for name, one in table["properties"].items()]

    def entries(self, key: Schema) -> Schema:
        """Returns the table of a key, or that of each entry of a list."""
        table = self.followed(key)
        table = self.followed(table["items"]) if table.get("type") == "array" else table
        return self.one_of_several(table)[0]

    @staticmethod
    def referred(section: str, common: list[str], tag: str, has_own: bool) -> str:
        """Returns the sentence on the keys that another section has."""
        names = listed([f"`{name}`" for name in [*common, tag]], "and")
        also = "Also " if has_own else ""
        return f"{also}{names} with the keys of that value, as in [`[{section}]`](#{section}).\n"

    def varied(self, variants: list[Schema]) -> list[str]:
        """Returns the rows of keys that depend on the value of another key."""
        tag = self.tag(variants[0])
        rows = []
        first: dict[str, str] = {}
        for variant in variants:
            name = variant["properties"][tag]["const"]
            default = "" if tag in variant.get("required", []) else " This is the default."
            rows.append(f"| **`{tag} = \"{name}\"`** | | | {cell(variant['description'])}{default} |")
            own = {key: value for key, value in variant["properties"].items() if key != tag}
            repeated: dict[str, list[str]] = {}
            for key, value in own.items():
                row = self.row(key, value, key in variant.get("required", []))
                there = first.setdefault(row, name)
                if there != name and len(row.rsplit(" | ", 1)[1].split()) > LONG:
                    repeated.setdefault(there, []).append(f"`{key}`")
                else:
                    rows.append(row)
            rows += [f"| {', '.join(keys)} | | | as under `{there}` |" for there, keys in repeated.items()]
        return rows

    def rows(self, keys: dict[str, Schema], required: list[str]) -> str:
        return "\n".join([COLUMNS, *(self.row(name, key, name in required) for name, key in keys.items())])

    def row(self, name: str, key: Schema, needed: bool) -> str:
        kind = self.followed(key)
        default = "needed" if needed else f"`{toml(key['default'])}`" if "default" in key else "-"
        words = [cell(key.get("description") or kind.get("description", ""))]
        words += [f"`{one['const']}`: {cell(one['description'])}" for one in self.words(kind)]
        range_ = "" if self.words(kind) else self.range_of(kind)
        type_ = ", ".join(part for part in (self.type_of(key), range_) if part)
        type_ = type_.removeprefix("number, ")
        if said := unit(name):
            type_ += f" \\[{said}\\]" if said in BESIDE else ""
            words[0] = re.sub(rf",? in {re.escape(said)}(?= |[,.:;]|$)", "", words[0], count=1)
        return f"| `{name}` | {type_} | {default} | {'<br>'.join(words)} |"

    def type_of(self, key: Schema) -> str:
        kind = self.followed(key)
        if "anyOf" in kind and not self.variants(kind):
            return alternatives([self.type_of(one) for one in kind["anyOf"]], quoted=False)
        if self.is_table(key):
            return "list of tables" if kind.get("type") == "array" else "table"
        if self.words(kind):
            return "word"
        if kind["type"] == "array":
            few = kind.get("minItems"), kind.get("maxItems")
            if few == (2, 3):
                return "vector"
            count = "" if few == (None, None) else f"{few[0]} " if few[0] == few[1] else f"{few[0]} to {few[1]} "
            return f"list of {count}{plural(self.type_of(kind['items']))}"
        names = {"number": "number", "integer": "integer", "boolean": "boolean", "string": "text"}
        return names[kind["type"]]

    def range_of(self, kind: Schema) -> str:
        if "anyOf" in kind:
            return next((said for one in kind["anyOf"] if (said := self.range_of(self.followed(one)))), "")
        if kind.get("type") == "array":
            return self.range_of(self.followed(kind["items"]))
        if words := self.words(kind):
            return ", ".join(f"`{one['const']}`" for one in words)
        if "maxLength" in kind:
            letters = f", of `{kind['pattern']}`" if "pattern" in kind else ""
            return f"{kind.get('minLength', 0)} to {kind['maxLength']} characters{letters}"
        low = f"> {kind['exclusiveMinimum']:g}" if "exclusiveMinimum" in kind else ""
        low = f">= {kind['minimum']:g}" if "minimum" in kind else low
        if "maximum" in kind:
            return f"{kind['minimum']:g} to {kind['maximum']:g}" if "minimum" in kind else f"<= {kind['maximum']:g}"
        return low

    def heading(self, path: str, several: bool) -> str:
        return f"`[[{path}]]`" if several else f"`[{path}]`"

    def one_of_several(self, table: Schema) -> tuple[Schema, bool]:
        """Returns the table of a choice of table or list, and whether a list is allowed."""
        options = [self.followed(one) for one in table.get("anyOf", [])]
        found = [one for one in options if "properties" in one]
        lists = any(one.get("type") == "array" for one in options)
        return (found[0], lists) if len(found) == 1 and "properties" not in table else (table, False)

    def variants(self, table: Schema) -> list[Schema]:
        """Returns the alternative tables that the value of one key selects."""
        options = table.get("oneOf", [])
        for one in table.get("anyOf", []):
            options = options or one.get("oneOf", [])
        options = options or table.get("anyOf", [])
        options = [one for one in options if not one.get("deprecated")]
        return options if options and all("properties" in one for one in options) else []

    def same(self, path: str, keys: dict[str, Schema], variants: list[Schema]) -> tuple[str, list[str]] | None:
        """Returns the section with the same variants, and the names of keys that it also has."""
        for name in ("formation", "law"):
            there = self.followed(self.schema["properties"][name])
            others = [one["properties"] for one in self.variants(there)]
            if name != path and variants and others == [one["properties"] for one in variants]:
                return name, [key for key, value in keys.items() if there.get("properties", {}).get(key) == value]
        return None

    @staticmethod
    def tag(variant: Schema) -> str:
        return next(name for name, key in variant["properties"].items() if "const" in key)

    def words(self, kind: Schema) -> list[Schema]:
        options = [one for one in kind.get("oneOf", []) if not one.get("deprecated")]
        return options if all("const" in one for one in options) else []

    def is_subtable(self, key: Schema) -> bool:
        """Returns whether the values of a key are tables only, which have a section."""
        return self.is_table(key) and self.type_of(key) in ("table", "list of tables")

    def is_table(self, key: Schema) -> bool:
        kind = self.followed(key)
        if kind.get("type") == "array":
            return self.is_table(kind["items"])
        if "anyOf" in kind and "properties" not in kind and not self.variants(kind):
            return any(self.is_table(one) for one in kind["anyOf"])
        return "properties" in kind or bool(self.variants(kind)) or isinstance(kind.get("additionalProperties"), dict)

    def followed(self, key: Schema) -> Schema:
        return self.definitions[key["$ref"].rsplit("/", 1)[1]] if "$ref" in key else key


def unit(name: str) -> str:
    return UNNAMED.get(name) or next((said for end, said in UNITS.items() if name.endswith(end)), "")


def plural(said: str) -> str:
    many = ("number", "integer", "vector", "table", "word", "text")
    return f"{said}s" if said in many else said.replace("list", "lists", 1)


def alternatives(names: list[str], quoted: bool = True) -> str:
    return listed([f'`"{name}"`' for name in names] if quoted else names, "or")


def listed(names: list[str], last: str) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}"


def toml(value: Any) -> str:
    return json.dumps(value)


def wrapped(page: str) -> Iterator[str]:
    """Yields the lines of a page, with paragraphs wrapped at 120 characters."""
    is_code = False
    for line in page.split("\n"):
        is_code ^= line.startswith("```")
        is_kept = line.startswith("|") or len(line) <= 120 or is_code
        yield from [line] if is_kept else textwrap.wrap(line, 120, break_on_hyphens=False)


def sentence(words: str) -> str:
    return " ".join(words.split())


def cell(words: str) -> str:
    return sentence(words).replace("|", "\\|")


if __name__ == "__main__":
    sys.stdout.write(Reference(json.load(sys.stdin)).page())
