"""The one exception that a user sees: a sentence saying what, where and what to do; names that may have been meant."""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

# share of letters in common; one wrong letter of three still passes, bogus for burns does not
_NEAR = 0.65


class UserError(Exception):
    """A user's mistake or a missing part of the machine.

    The message is one sentence: what is wrong, where, and what to do. The command line prints it
    without a traceback and exits with 2.
    """


def near_names(name: str, known: Sequence[str], most: int = 1) -> list[str]:
    """Of ``known`` those that ``name`` may have been meant for: nearly its letters, or one within the other."""
    close = get_close_matches(name, known, n=most, cutoff=_NEAR)
    within = [k for k in known if k not in close and min(len(k), len(name)) > 2 and (name in k or k in name)]
    return [*close, *within][:most]
