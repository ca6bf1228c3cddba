"""The one exception that a user sees: a sentence saying what, where and what to do."""

from __future__ import annotations


class UserError(Exception):
    """A user's mistake or a missing part of the machine.

    The message is one sentence: what is wrong, where, and what to do. The command line prints it
    without a traceback and exits with 2.
    """
