"""Steps of equal length over a span of time."""

import math

_ROUNDING = 1e-6
"""Share of a step by which a span may exceed a whole number of steps without another one."""


def step_count(span_s: float, step_s: float) -> int:
    """Count the steps that cover a span.

    Rounding adds none: 1.05 s are 7 steps of 0.15 s, although their quotient is above 7.

    Returns
    -------
    int
        Number of steps, at least 1; the last one may end after the span.
    """
    return max(math.ceil(span_s / step_s - _ROUNDING), 1)
