"""List the figures in the documents, and statements that occur twice: ``python -m tools.docs.figures``.

A figure is a number with a unit; its source is the command that the page names before it. Two statements on different
pages with nearly the same words but different numbers of the same unit contradict each other or were measured twice;
with the same numbers, one should be replaced by a link.
"""

import argparse
import re
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"
BESIDE = ("README.md", "CONTRIBUTING.md")
"""Pages in the folder above."""
LEFT_OUT = ("lab", "adr", "images")
"""Folders whose pages record one moment and are not updated."""
MIN_WORDS = 6
"""Statements with fewer words are too short to compare."""
ALIKE = 0.4
"""Jaccard index of the words above which two statements have the same subject."""
_UNITS = (
    r"ms|us|ns|s|min|h|Hz|fps|MB|GB|kB|KiB|MiB|GiB|px|DN|deg|arcsec|mm|cm|m|km|m/s|cm/s|mm/s|rad/s|deg/s|kg|N|W|V"
    r"|%|dB|ppm|frames a second|frames per second|times"
)
_FIGURE = re.compile(rf"(?<![\w.#-])(\d+(?:[ ,]\d{{3}})*(?:\.\d+)?(?:e-?\d+)?)\s?({_UNITS})(?![\w/])")
_SENTENCE = re.compile(r"(?<=[.;:])\s+(?=[A-Z`*(\[])|\n\s*\n|\n(?=[|*-] )")
_WORD = re.compile(r"[a-z]{3,}")
_COMMAND = re.compile(r"(?:python -m (?:tools|flyaround)|flyaround|make|pytest)\b[^`\n]*")
_CODE = re.compile(r"```.*?```", re.DOTALL)
_COMMON = frozenset(
    [
        "the",
        "and",
        "that",
        "with",
        "for",
        "from",
        "are",
        "has",
        "have",
        "its",
        "one",
        "two",
        "than",
        "not",
        "but",
        "all",
        "any",
        "each",
        "this",
        "which",
    ]
)


@dataclass(frozen=True)
class Statement:
    """A sentence or table row with figures.

    Parameters
    ----------
    page : Path
        Path relative to ``docs``.
    text : str
        Text on one line.
    figures : frozenset of tuple of str
        Numbers with their units.
    words : frozenset of str
        Words that are not among the most common ones.
    source : str, optional
        Command that the page names last before the end of the statement; empty if it names none.
    """

    page: Path
    text: str
    figures: frozenset[tuple[str, str]]
    words: frozenset[str]
    source: str = ""


def statements(page: Path, text: str) -> list[Statement]:
    """Return the statements of a page that have figures, without code blocks."""
    blocks = _CODE.findall(text)
    text = _CODE.sub("\n\n\0\n\n", text)
    result, source = [], ""
    for part in _SENTENCE.split(text):
        code = blocks.pop(0) if "\0" in part else part
        source = next(reversed(re.findall(rf"(?:^|`)({_COMMAND.pattern})", code, re.MULTILINE)), source)
        line = " ".join(part.split())
        figures = frozenset(_FIGURE.findall(line))
        words = frozenset(_WORD.findall(line.lower())) - _COMMON
        if figures:
            result.append(Statement(page, line, figures, words, source))
    return result


def all_statements(docs: Path = DOCS) -> list[Statement]:
    """Return the statements of all current pages and of those `BESIDE` the folder."""
    pages = sorted(p for p in docs.rglob("*.md") if p.relative_to(docs).parts[0] not in LEFT_OUT)
    pages += [docs.parent / name for name in BESIDE]
    return [s for p in pages for s in statements(_name(p, docs), p.read_text(encoding="utf-8"))]


def _name(page: Path, docs: Path) -> Path:
    return page.relative_to(docs) if page.is_relative_to(docs) else Path("..") / page.name


def repeated(statements_: Sequence[Statement]) -> Iterable[tuple[Statement, Statement]]:
    """Yield pairs of statements of different pages with the same subject and figures of a common unit."""
    long = [s for s in statements_ if len(s.words) >= MIN_WORDS]
    for k, a in enumerate(long):
        for b in long[k + 1 :]:
            if a.page == b.page or not {u for _, u in a.figures} & {u for _, u in b.figures}:
                continue
            if len(a.words & b.words) >= ALIKE * len(a.words | b.words):
                yield a, b


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the figures by page, or the statements that occur twice; return 1 if two of these contradict each other."""
    parser = argparse.ArgumentParser(prog="python -m tools.docs.figures", description=__doc__)
    parser.add_argument("--all", action="store_true", help="print every figure with source and statement")
    options = parser.parse_args(arguments)
    found = all_statements()
    if options.all:
        for s in found:
            numbers = ", ".join(f"{n} {u}" for n, u in sorted(s.figures))
            print(f"{s.page}: {numbers}: {s.source or 'written by hand'}: {s.text}")
        return 0
    differ = 0
    for a, b in repeated(found):
        has_same_figures = a.figures == b.figures
        differ += not has_same_figures
        print(f"{'repeated' if has_same_figures else 'DIFFERS'}\n  {a.page}: {a.text}\n  {b.page}: {b.text}")
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())
