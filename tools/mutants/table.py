"""The result as text: by folder how many were noticed, then every bug that was not."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tools.mutants.scope import PYTHON, SHADERS, folder_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

WORDS = ("killed", "timeout", "survived", "not covered")
NOTICED = {"killed", "timeout"}


def noticed(rows: Sequence[Mapping[str, Any]]) -> int:
    """How many a test failed on, or never ended with."""
    return sum(row["word"] in NOTICED for row in rows)


def text(rows: Sequence[Mapping[str, Any]]) -> str:
    """A table, then the diff of each that nothing noticed."""
    out = [f"{'':20s}" + "".join(f"{word:>13s}" for word in WORDS) + f"{'noticed':>10s}"]
    for folder in (*PYTHON, SHADERS, "in all"):
        own = [row for row in rows if folder in {"in all", folder_of(row["file"])}]
        if own:
            counts = "".join(f"{sum(r['word'] == word for r in own):13d}" for word in WORDS)
            out.append(f"{folder:20s}{counts}{noticed(own) / len(own):10.0%}")
    for row in sorted(rows, key=lambda r: (r["file"], r["line"])):
        if row["word"] not in NOTICED:
            out += [
                "",
                f"{row['file']}:{row['line']}  {row['kind']}: {row['word']} by {row['asked']} tests",
                row["diff"],
            ]
    return "\n".join(out) + "\n"
