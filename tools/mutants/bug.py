"""A planted bug: where it is, what it replaces, and the text of the file with it."""

from __future__ import annotations

import difflib
import hashlib
from dataclasses import dataclass


@dataclass(frozen=True)
class Bug:
    """One small change of one file.

    Parameters
    ----------
    file : relative to the root. line : from 1. kind : what was done, in a few words. occurrence : which of its kind
    in the file, from 0.
    """

    file: str
    line: int
    kind: str
    occurrence: int

    def name(self, source: str) -> str:
        """A name that stays while the file does, under which a result is kept."""
        text = f"{self.file}\n{self.kind}\n{self.occurrence}\n{source}"
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def difference(before: str, after: str) -> str:
    """The changed lines alone, as ``-`` and ``+``."""
    lines = difflib.unified_diff(before.splitlines(), after.splitlines(), lineterm="", n=0)
    return "\n".join(line for line in lines if line[:3] not in {"---", "+++"} and not line.startswith("@@"))
