"""Dense output of the integrator: piecewise polynomials of degree seven, evaluated at any time."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from flyaround.simulator.runtime.arrays import FloatArray

_DEGREE = 7  # degree of the interpolating polynomials


def _monomials() -> FloatArray:
    """Return the coefficients (7, 8) of x^0 to x^7 in the products x, x (1 - x), x^2 (1 - x), ... of DOP853."""
    rows = []
    for k in range(_DEGREE):
        product = np.array([1.0])
        for i in range(k, -1, -1):
            product = np.convolve(product, [0.0, 1.0] if i % 2 == 0 else [1.0, -1.0])
        rows.append(np.pad(product, (0, _DEGREE + 1 - len(product))))
    return np.array(rows)


_MONOMIALS = _monomials()


@dataclass(frozen=True, eq=False)
class DenseOutput:
    """A state over time, as piecewise polynomials.

    Parameters
    ----------
    starts_s : (n,) list of float
        Start of each piece, increasing; at a start the later piece applies, so that a jump is included.
    lengths_s : (n,) list of float
        Lengths of the pieces.
    coefficients : (n, 8, width) array
        Coefficients of powers 0 to 7 of the elapsed fraction of the piece.
    """

    starts_s: list[float]
    lengths_s: list[float]
    coefficients: FloatArray

    def __call__(self, t_s: float) -> FloatArray:
        """Return the state (width,)."""
        k = min(max(bisect_right(self.starts_s, t_s) - 1, 0), len(self.starts_s) - 1)
        x = (t_s - self.starts_s[k]) / self.lengths_s[k]
        x2 = x * x
        x4 = x2 * x2
        powers = np.array((1.0, x, x2, x2 * x, x4, x4 * x, x4 * x2, x4 * x2 * x))
        return np.asarray(powers @ self.coefficients[k])

    def rate(self, t_s: float) -> FloatArray:
        """Return the derivative (width,) [s-1]."""
        k = min(max(bisect_right(self.starts_s, t_s) - 1, 0), len(self.starts_s) - 1)
        h = self.lengths_s[k]
        x = (t_s - self.starts_s[k]) / h
        x2 = x * x
        x4 = x2 * x2
        slopes = np.array((0.0, 1.0, 2 * x, 3 * x2, 4 * x2 * x, 5 * x4, 6 * x4 * x, 7 * x4 * x2))
        return np.asarray(slopes @ self.coefficients[k]) / h

    @staticmethod
    def concatenate(parts: Sequence[DenseOutput]) -> DenseOutput:
        """Concatenate consecutive spans."""
        return DenseOutput(
            [t for p in parts for t in p.starts_s],
            [h for p in parts for h in p.lengths_s],
            np.concatenate([p.coefficients for p in parts]),
        )


def check_span(duration_s: float) -> None:
    """Raise ValueError if a span of a propagation is negative or not finite."""
    if not 0 <= duration_s < math.inf:
        raise ValueError(f"the span is {duration_s} s, allowed: 0 or more, and finite")


def integrate(
    derivative: Callable[[float, FloatArray], FloatArray],
    start: FloatArray,
    span_s: tuple[float, float],
    *,
    rtol: float,
    atol: FloatArray | float,
    max_step_s: float,
) -> DenseOutput:
    """Integrate a state over a span.

    Parameters
    ----------
    derivative : callable
        Function of time [s] and state (width,).
    start : (width,) array
        Initial state.
    span_s : tuple of float
        Start and end.
    rtol : float
        Relative tolerance of the step control.
    atol : array or float
        Absolute tolerance of the step control.
    max_step_s : float
        Largest step, which bounds the error of the polynomials.

    Raises
    ------
    UserError
        If the integrator fails.
    ValueError
        If a number of the initial state or the span is not finite; the integrator would never end.

    References
    ----------
    Hairer, Norsett & Wanner (1993), Solving Ordinary Differential Equations I: DOP853 and its dense output.
    """
    from scipy.integrate import solve_ivp  # noqa: PLC0415 - slow to import

    if not (np.isfinite(start).all() and np.isfinite(span_s).all()):
        raise ValueError(
            f"cannot integrate from {start.tolist()} over {span_s} s: all numbers must be finite"
        )
    result = solve_ivp(
        derivative,
        span_s,
        start,
        method="DOP853",
        rtol=rtol,
        atol=atol,
        max_step=max_step_s,
        dense_output=True,
    )
    if not result.success or result.sol is None:
        raise UserError(
            f"the motion cannot be integrated beyond {result.t[-1]:.0f} s after the start, as in a "
            "fall into a body's centre: "
            "shorten duration_s, or change the burns or the orbit"
        )
    steps: list[Any] = list(result.sol.interpolants)
    nested = np.array([s.F for s in steps], float)
    coefficients = np.asarray(np.einsum("kj,skw->sjw", _MONOMIALS, nested), float)
    coefficients[:, 0] += [s.y_old for s in steps]
    return DenseOutput([float(s.t_old) for s in steps], [float(s.h) for s in steps], coefficients)
