"""Calibration of the confidence and the covariance for one target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Dict, Tuple

from flyaround.hil.board.json_values import number, numbers, whole

# Number of weights; limits of what a file may ask for, which a usable calibration is far inside.
N_WEIGHTS, MAX_WEIGHT, MAX_COVARIANCE_FACTOR = 12, 1000.0, 100.0


@dataclass(frozen=True)
class Calibration:
    """Weights of the confidence, and factor of the covariance, for one target.

    Parameters
    ----------
    weights : (12,) tuple of float
        Bias, and weights of the regressors of the confidence.
    covariance_factor : float
        Factor of the covariance.
    frames : int
        Number of answers that determined it; 0 for a preset.
    """

    weights: Tuple[float, ...]
    covariance_factor: float = 1.0
    frames: int = 0

    @staticmethod
    def from_dict(values: Dict[str, Any]) -> Calibration:
        """Read a calibration from parsed JSON.

        Parameters
        ----------
        values : dict
            Values by the names of the parameters.

        Returns
        -------
        Calibration
            Calibration with values inside the limits.

        Raises
        ------
        KeyError, OverflowError, TypeError, ValueError
            If a value is missing, unknown, not finite or out of limits.
        """
        if set(values) != {"weights", "covariance_factor", "frames"}:
            raise ValueError(f"its calibration has the values {', '.join(sorted(map(str, values)))}")
        weights, factor = numbers(values["weights"], N_WEIGHTS), number(values["covariance_factor"])
        if not (abs(weights) <= MAX_WEIGHT).all():
            raise ValueError(f"a weight of its calibration is above {MAX_WEIGHT:g}")
        if not 1 / MAX_COVARIANCE_FACTOR <= factor <= MAX_COVARIANCE_FACTOR:
            raise ValueError(f"its calibration scales the covariance by {factor:g}")
        return Calibration(tuple(weights.tolist()), factor, whole(values["frames"]))
