"""Mission times, durations and speeds as operators read them: one format each, in every panel, map and message."""

from __future__ import annotations

import re

SPEED_DECIMALS = 4
"""Decimals of a speed in m/s: a tenth of a millimetre per second, at which a hold drifts 0.5 m in an orbit."""
CLOCK_TIME = re.compile(r"(?:T\+)?(?:(\d{1,6}):)?([0-5]?\d):([0-5]?\d(?:\.\d*)?)")


def mission_time(t_s: float, *, whole: bool = False) -> str:
    """Return the time since the scenario's start as T+hh:mm:ss.s.

    Parameters
    ----------
    t_s : float
        Time since the scenario's start.
    whole : bool, optional
        True for the seconds that have passed, without tenths.

    Returns
    -------
    str
        The time; never negative.
    """
    shown_s = max(t_s, 0.0)
    minutes, seconds = divmod(int(shown_s) if whole else round(shown_s, 1), 60)
    hours, minutes = divmod(int(minutes), 60)
    return f"T+{hours:02d}:{minutes:02d}:{f'{seconds:02d}' if whole else f'{seconds:04.1f}'}"


def mission_seconds(text: str) -> float:
    """Read a mission time: a number of seconds, or hours, minutes and seconds as `mission_time` writes them.

    Returns
    -------
    float
        Time since the scenario's start [s].

    Raises
    ------
    ValueError
        If the text is neither.
    """
    parts = CLOCK_TIME.fullmatch(text.strip())
    return float(text) if parts is None else 3600 * int(parts[1] or 0) + 60 * int(parts[2]) + float(parts[3])


def duration_text(seconds: float) -> str:
    """Return a duration in seconds, from a minute on with minutes, and from an hour on with hours.

    Returns
    -------
    str
        Whole seconds with their units, such as ``2 min 05 s``.
    """
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min {rest:02d} s"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


def speed_text(speed_m_s: float, *, signed: bool = False) -> str:
    """Return a speed, or the size of a burn, in m/s.

    Returns
    -------
    str
        The speed with its unit, without minus zero.
    """
    return f"{speed_m_s:{'+' * signed}z.{SPEED_DECIMALS}f} m/s"
