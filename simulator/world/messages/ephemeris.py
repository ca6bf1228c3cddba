"""Ephemeris of an orbit message: interpolation by its segments' method and frame, converted to GCRS."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.world.messages.ccsds_frames import motion_in_gcrf

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.ephemeris.body import Body
    from flyaround.simulator.world.messages.ccsds import Segment
    from flyaround.simulator.world.time.instant import Instant

ROUNDING_S = 1e-6
"""Tolerance of times outside a span, for rounding [s]."""
_METRE_VELOCITY_RATIO = 100.0
"""Ratio of velocity to circular speed above which velocities must be in metres, not kilometres, per second."""
_MAX_CHORD_RAD = 0.5
"""Largest angle along the orbit between two lines for comparing the chord with the velocity."""
_CHORD_TOLERANCE = 0.02
"""Largest difference between chord and velocity, over the circular speed, that a burn or rounding may explain."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Piece:
    """A segment's lines as functions of time, in the segment's own frame.

    Parameters
    ----------
    segment : Segment
        Source, for messages.
    frame : str
        Frame of the lines.
    frozen : Instant or None
        Time at which a frame of date is frozen, or None.
    times_s : (n,) array
        Times of the lines since the ephemeris's epoch [s].
    states : (n, 6) array
        Position [m] and velocity [m s-1].
    method : str
        HERMITE, LAGRANGE or LINEAR.
    lines : int
        Number of lines per polynomial.
    first_s : float
        Start of the span in which the message allows interpolation.
    last_s : float
        End of this span.
    """

    segment: Segment
    frame: str
    frozen: Instant | None
    times_s: FloatArray
    states: FloatArray
    method: str
    lines: int
    first_s: float
    last_s: float
    _polynomials: dict[int, FloatArray] = field(default_factory=dict, init=False)

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position [m], velocity [m s-1] and acceleration [m s-2] in the segment's frame.

        The Hermite polynomial interpolates positions with velocities as slopes, and its derivative is the velocity.
        Lagrange and linear interpolation treat positions and velocities separately.
        """
        t, n = self.times_s, len(self.times_s)
        k = min(max(int(np.searchsorted(t, t_s, side="right")), 1), n - 1) if n > 1 else 0
        if self.method == "LINEAR":
            slope = (self.states[k] - self.states[k - 1]) / (t[k] - t[k - 1])
            y = self.states[k - 1] + slope * (t_s - t[k - 1])
            return y[:3], y[3:], slope[3:]
        lines = min(self.lines, n)
        # an odd number of lines is centred on the nearest one
        nearest = k if lines % 2 == 0 or n == 1 else k - int(t_s - t[k - 1] < t[k] - t_s)
        first = min(max(nearest - lines // 2, 0), n - lines)
        middle, half = (t[max(k - 1, 0)] + t[k]) / 2, (t[k] - t[k - 1]) / 2 if n > 1 else 1.0
        if k not in self._polynomials:
            self._polynomials[k] = self._coefficients(slice(first, first + lines), middle, half)
        coefficients = self._polynomials[k]
        j, x = np.arange(len(coefficients)), (t_s - middle) / half
        powers = x**j
        value, slope = powers @ coefficients, (j[1:] * powers[:-1]) @ coefficients[1:] / half
        if self.method != "HERMITE":
            return value[:3], value[3:], slope[3:]
        return value, slope, (j[2:] * j[1:-1] * powers[:-2]) @ coefficients[2:] / half**2

    def _coefficients(self, near: slice, middle_s: float, half_s: float) -> FloatArray:
        """Return the coefficients of the polynomial through some lines.

        It is in powers of the time from the middle of an interval, over half its length, so that high-order terms are
        small and the sum is accurate.
        """
        from scipy.interpolate import KroghInterpolator  # noqa: PLC0415 - slow to import

        t, states = self.times_s[near], self.states[near]
        if self.method == "HERMITE":
            # a repeated point gives its value, then its slope
            t, states = np.repeat(t, 2), states.reshape(-1, 3)
        slopes = KroghInterpolator(t, states).derivatives(middle_s)
        j = np.arange(len(slopes))
        terms = half_s**j / np.cumprod(np.maximum(j, 1.0))
        return np.asarray(slopes * terms[:, None])


@dataclass(frozen=True, eq=False, kw_only=True)
class Ephemeris:
    """Position, velocity and acceleration of a craft over time, in GCRS from its central body.

    Parameters
    ----------
    where : str
        File name in messages.
    epoch : Instant
        Origin of times.
    pieces : sequence of Piece
        Segments in order of their first times.
    """

    where: str
    epoch: Instant
    pieces: Sequence[Piece]

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position [m], velocity [m s-1] and acceleration [m s-2]; a segment applies from its first time on."""
        earlier = [p for p in self.pieces if p.first_s <= t_s]
        # the later of overlapping pieces; between and outside pieces, where only rounding leads, the nearest one
        piece = next(
            (p for p in reversed(earlier) if t_s <= p.last_s), earlier[-1] if earlier else self.pieces[0]
        )
        return motion_in_gcrf(piece.frame, piece.frozen or self.epoch.plus(t_s), *piece(t_s))

    @property
    def end_s(self) -> float:
        """End of the span without gaps, from the epoch [s]."""
        reach = 0.0
        for piece in self.pieces:
            if piece.first_s <= reach + ROUNDING_S:
                reach = max(reach, piece.last_s)
        return reach

    def require_span(self, duration_s: float) -> None:
        """Raise if the message does not cover a span from its epoch on.

        Raises
        ------
        UserError
            If it does not, or has a gap.
        """
        starts = any(p.first_s <= ROUNDING_S and p.last_s >= -ROUNDING_S for p in self.pieces)
        if not starts or self.end_s < duration_s - ROUNDING_S:
            spans = " and ".join(
                f"{self.epoch.plus(p.first_s).iso()} to {self.epoch.plus(p.last_s).iso()}"
                for p in self.pieces
            )
            span = self.epoch.iso() + (f" to {self.epoch.plus(duration_s).iso()}" if duration_s else "")
            raise UserError(f"{self.where} covers {spans}, not {span}: choose an epoch and a duration within")
        for piece in self.pieces:
            t = piece.times_s
            is_used = (t[1:] > ROUNDING_S) & (t[:-1] < max(duration_s - ROUNDING_S, -ROUNDING_S))
            for k in np.flatnonzero(is_used):
                piece.segment.refuse_gap(t, int(k) + 1)

    def refuse_impossible(self, body: Body) -> None:
        """Raise if lines cannot belong to an orbit about the body.

        Raises
        ------
        UserError
            If values are in other units, or below the surface or out of reach, or velocities contradict the positions.
        """
        for piece in self.pieces:
            _refuse_impossible(piece, body)

    @property
    def interpolation(self) -> str:
        """Name of the interpolation."""
        names = {_interpolation_name(p) for p in self.pieces}
        return " and ".join(sorted(names))


def _refuse_impossible(piece: Piece, body: Body) -> None:
    segment, r, v = piece.segment, piece.states[:, :3], piece.states[:, 3:]
    radii, circular = np.linalg.norm(r, axis=1), np.sqrt(body.mu_m3_s2 / np.linalg.norm(r, axis=1))
    start = f"{segment.where}, line {segment.rows[0][0]}"
    # read as km the orbit is beyond the body, as metres it is within reach
    if body.radius_m < float(np.median(radii)) / 1e3 < body.reach_m < float(np.median(radii)):
        raise UserError(
            f"{start}: the values look like metres, and CCSDS has km and km/s: divide them by 1000"
        )
    for (line, _), distance in zip(segment.rows, radii.tolist(), strict=True):
        problem = body.distance_problem(distance)
        if problem:
            raise UserError(f"{segment.where}, line {line}: the position {problem}")
    if float(np.median(np.linalg.norm(v, axis=1) / circular)) > _METRE_VELOCITY_RATIO:
        raise UserError(f"{start}: the velocities look like m/s, and CCSDS has km/s: divide them by 1000")
    steps = np.diff(piece.times_s)
    error_m_s = np.linalg.norm(np.diff(r, axis=0) / steps[:, None] - (v[1:] + v[:-1]) / 2, axis=1)
    angle = steps * (circular / radii)[:-1]
    is_wrong = np.flatnonzero(
        (angle < _MAX_CHORD_RAD) & (error_m_s > circular[:-1] * (_CHORD_TOLERANCE + angle**2))
    )
    if len(is_wrong):
        k = int(is_wrong[0])
        raise UserError(
            f"{segment.where}, line {segment.rows[k + 1][0]}: the velocities differ by {error_m_s[k]:.4g} m/s "
            "from the rate of change of the positions: check units, axes and frame"
        )


def _interpolation_name(piece: Piece) -> str:
    if piece.method == "LINEAR":
        return "linear"
    degree = 2 * piece.lines - 1 if piece.method == "HERMITE" else piece.lines - 1
    return f"{piece.method.capitalize()} of degree {degree}"
