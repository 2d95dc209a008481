#!/usr/bin/env python3
"""Checks comments, docs, string literals and commit subjects. Limits: 30 words a sentence, 120 characters a line
(tables and output in Markdown excepted), no phrase of PHRASES, and 72 characters a subject (since the last tag, 200
commits). Prints `FILE:LINE: RULE: TEXT` for each finding and exits with 1 if there is one."""
import re, subprocess, sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PHRASES = re.compile(
    r"\b(who|whom|whoever|(?:no|every|any|some)body|(?:some|every|any)one|so many|as much|such a one"
    r"|there (?:is|are) none|of (?:which|whom)|what (?:is|was|are|were) (?:told|asked|known|meant))\b", re.I)
# Start of a place, rule, and the reason why the rule does not hold there.
EXCEPT = [("tests/prose.py", "phrases", "defines them"), ("commit 1f1bfd3", "subjects", "older than the check"),
          ("crates/report/src/report/tests.rs", "sentences", "lists the keys of report.json")]
RUST = re.compile(r'(?P<comment>//[^\n]*)|r(?P<hash>#*)"(?P<raw>.*?)"(?P=hash)|"(?P<string>(?:\\.|[^"\\])*)"'
                  r"|'(?:\\[^\n']*|[^\\'\n])'", re.S)
PYTHON = re.compile(r'(?P<comment>#[^\n]*)|"""(?P<raw>.*?)"""|"(?P<string>(?:\\.|[^"\\\n])*)"', re.S)
HASH = re.compile(r"(?P<comment>(?<!\S)#[^\n]*)|(?P<raw>$^)|(?P<string>$^)")
SYNTAX = {".rs": RUST, ".wgsl": RUST, ".js": RUST, ".py": PYTHON, ".sh": HASH, ".toml": HASH, ".yml": HASH, ".md": None}
CODE = re.compile(r" = | => |[;{(]\s*$|</")  # In a string literal: TOML, JavaScript, HTML.
ITEM = re.compile(r"\s*([-*#|>`]|\d+\.)")


def markdown(text):  # Yields (line, text) of each paragraph, list item and table cell outside code fences.
    fenced, block, start = False, [], 1
    for number, line in enumerate(text.split("\n") + [""], 1):
        fence = line.lstrip().startswith(("```", "~~~"))
        if block and (fence or fenced or not line.strip() or ITEM.match(line)):
            yield start, " ".join(block)
            block = []
        fenced ^= fence
        if not fence and not fenced and line.strip():
            *cells, last = line.split(" | ") if line.lstrip().startswith("|") else [line]
            yield from ((number, cell) for cell in cells)
            start = start if block else number
            block.append(last)


def source(text, syntax):  # Yields (line, text) of each paragraph of comments and each string of four words or more.
    fenced, block, start, last = False, [], 0, -1
    for token in syntax.finditer(text):
        line = text.count("\n", 0, token.start()) + 1
        if token["comment"] is not None:
            body = re.sub(r"^(//[/!]?|#+!?)", "", token["comment"]).strip()
            fenced ^= body.startswith("```")
            if block and (line != last + 1 or not body or ITEM.match(body)):
                yield start, " ".join(block)
                block = []
            start, last = start if block else line, line
            block += [body] * (not fenced)
        elif (literal := token["string"] or token["raw"] or "").count(" ") > 2 and not CODE.search(literal):
            yield line, re.sub(r"\\n?\s*|\s+", " ", literal)
    yield start, " ".join(block)


def findings():
    run = lambda *command: subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for path in (path for path in map(Path, run("git", "ls-files").split()) if path.suffix in SYNTAX):
        text, fenced = (ROOT / path).read_text(encoding="utf-8"), False
        for number, line in enumerate(text.split("\n"), 1):
            fenced ^= path.suffix == ".md" and line.lstrip().startswith("```")
            if len(line) > 120 and not fenced and not re.match(r"\s*(//[/!] )?\|", line):
                yield f"{path}:{number}", "lines", f"{len(line)} characters"
        for number, words in source(text, SYNTAX[path.suffix]) if SYNTAX[path.suffix] else markdown(text):
            words = re.sub(r"`[^`]*`", "`c`", words)
            for sentence in re.split(r"<br>| \| |(?<=[.!?])\s+(?=[A-Z`\[*(])", words):
                if sum(bool(re.search(r"\w", word)) for word in sentence.split()) > 30:
                    yield f"{path}:{number}", "sentences", sentence
                for found in PHRASES.finditer(sentence):
                    yield f"{path}:{number}", "phrases", f"{found[0]}: {sentence}"
    tags = run("git", "tag", "--sort=-creatordate", "--merged").split()
    since = [f"{tag}..HEAD" for tag in tags[:1]]
    for line in run("git", "log", "-200", "--no-merges", "--format=%h %s", *since).splitlines():
        if len(line.split(" ", 1)[1]) > 72:
            yield f"commit {line.split()[0]}", "subjects", line


kept = [one for one in findings() if not any(one[0].startswith(place) and one[1] == rule for place, rule, _ in EXCEPT)]
print(*(": ".join(one)[:200] for one in kept), f"{len(kept)} findings", sep="\n")
sys.exit(bool(kept))
