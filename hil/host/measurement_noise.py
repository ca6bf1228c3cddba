"""Error model of a board's poses for the filter, from an evaluation of its estimator."""

from __future__ import annotations

from pathlib import Path

import msgspec

from flyaround.hil.evaluate.pose_spread import PoseSpread
from flyaround.hil.navigation.measurement import PoseNoise
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import read_regular, refuse_deep

# Maximum size of an accepted metrics.json [bytes].
MAX_BYTES = 10_000_000

# Plausible range of an angle [rad] or a share that states an accuracy: from rounding errors to half a turn.
MIN_VALUE, MAX_VALUE = 1e-7, 3.2


class _Metrics(msgspec.Struct, frozen=True):
    """Fields that are read from metrics.json."""

    spread: PoseSpread | None = None


def read_pose_noise(path: Path) -> PoseNoise:
    """Read the noise model of an estimator's poses from the first method in a ``metrics.json``.

    Returns
    -------
    PoseNoise
        Standard deviations of the method's accepted poses; correlation, losses and gross errors have the defaults.

    Raises
    ------
    UserError
        If the file is invalid, or has too few accepted poses.
    """
    source = f"--pose-errors {path}"
    try:
        data = read_regular(path, MAX_BYTES)
        refuse_deep(data, str(path))
        spread = msgspec.json.decode(data, type=_Metrics).spread
    except OSError as error:
        raise UserError(
            f"{source} cannot be read: {error.strerror or error}; give the metrics.json of flyaround evaluate"
        ) from error
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise UserError(
            f"{source} is damaged: {error}; give the metrics.json of flyaround evaluate"
        ) from error
    if spread is None:
        raise UserError(
            f"{source} has no spread of poses, which needs ten accepted ones: evaluate more frames"
        )
    sizes = (spread.across_share, spread.along_share, spread.tilt_rad, spread.roll_rad)
    if not all(MIN_VALUE <= x <= MAX_VALUE for x in sizes):
        raise UserError(
            f"{source} has errors of {sizes}, allowed: {MIN_VALUE:g} to {MAX_VALUE:g}; evaluate again"
        )
    return PoseNoise(
        across_m=0.0,
        across_share=spread.across_share,
        along_share=spread.along_share,
        tilt_rad=spread.tilt_rad,
        roll_rad=spread.roll_rad,
    )
