"""Standard deviations of accepted poses along the camera's axes, for a navigation filter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.hil.evaluate.pose_errors import FrameScore

# Robust standard deviations beyond which an error component marks a wrong pose, excluded from the spread. Of normal
# errors one in two million is beyond it.
WRONG_SIGMAS = 5.0

# Ratio of a normal distribution's standard deviation to its median absolute deviation.
MAD_TO_SIGMA = 1.4826

# Minimum number of poses for a spread, chosen by eye, and smallest standard deviation reported.
MIN_POSES, MIN_SIGMA = 10, 1e-6


class PoseSpread(msgspec.Struct, frozen=True, kw_only=True):
    """RMS errors of accepted poses without wrong ones, whose share is ``wrong``.

    Parameters
    ----------
    across_share : float
        Position error across the boresight, over range.
    along_share : float
        Position error along the boresight, over range.
    tilt_rad : float
        Rotation error about each axis perpendicular to the boresight.
    roll_rad : float
        Rotation error about the boresight.
    available : float
        Share of the feasible frames that are accepted.
    wrong : float
        Share of the accepted poses that are wrong.
    """

    across_share: float
    along_share: float
    tilt_rad: float
    roll_rad: float
    available: float
    wrong: float


def pose_spread(records: Sequence[FrameScore]) -> PoseSpread | None:
    """Return the spread of a set of frames; None for fewer than ten accepted poses, or if all are wrong."""
    feasible = [r for r in records if r.feasible]
    accepted = [r for r in feasible if r.accepted]
    if len(accepted) < MIN_POSES:
        return None
    ranges_m = np.array([r.range_m for r in accepted])[:, None]
    shift = np.array([r.shift_camera_m for r in accepted], float) / ranges_m
    turn = np.radians(np.array([r.turn_camera_deg for r in accepted], float))
    parts = np.concatenate([shift, turn], axis=1)
    robust = MAD_TO_SIGMA * np.median(np.abs(parts), axis=0)
    right = np.all(np.abs(parts) <= WRONG_SIGMAS * np.maximum(robust, MIN_SIGMA), axis=1)
    if not right.any():
        return None
    rms = np.maximum(np.sqrt(np.mean(parts[right] ** 2, axis=0)), MIN_SIGMA)
    return PoseSpread(
        across_share=float(np.hypot(rms[0], rms[1]) / np.sqrt(2)),
        along_share=float(rms[2]),
        tilt_rad=float(np.hypot(rms[3], rms[4]) / np.sqrt(2)),
        roll_rad=float(rms[5]),
        available=len(accepted) / len(feasible),
        wrong=float(np.mean(~right)),
    )
