"""Scale of the pose errors in the current view: a factor per error component, estimated in flight."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray


@dataclass(frozen=True, kw_only=True)
class ScaleSettings:
    """Prior of the scale factors, and their forgetting. The values are hand-tuned.

    Parameters
    ----------
    prior_poses : float, optional
        Weight of the prior, whose errors have the expected variance [poses]; more than 1.
    retention : float, optional
        Share of the information that remains at the next pose; the rest returns to the prior.
    min_factor : float, optional
        Lower bound of a factor.
    max_factor : float, optional
        Upper bound of a factor.

    Raises
    ------
    ValueError
        If the prior's weight is 1 or less, for which the approximate mean of `ErrorScale.factors` is undefined.
    """

    prior_poses: float = 4.0
    retention: float = 0.97
    min_factor: float = 0.5
    max_factor: float = 8.0

    def __post_init__(self) -> None:
        if not self.prior_poses > 1:
            raise ValueError(f"prior_poses must be more than 1, got {self.prior_poses}")


@dataclass(frozen=True, eq=False, kw_only=True)
class ErrorScale:
    """Belief about the squared scale factors of a pose's six error components: independent inverse gamma distributions.

    An estimator's error model is an average over many views; in a single view the errors may be several times smaller
    or larger. The factor multiplies both the correlated errors of poses and their white part.

    Parameters
    ----------
    settings : ScaleSettings, optional
        Prior and forgetting.
    weight : float, optional
        Weight of the poses in the belief [poses].
    squares : (6,) array, optional
        Weighted sum of squared errors over their expected variance.

    References
    ----------
    Sarkka & Nummenmaa (2009), Recursive noise adaptive Kalman filtering by variational Bayesian approximations, IEEE
    Trans. Automatic Control 54(3); here with one iteration, and forgetting towards the prior.
    """

    settings: ScaleSettings = field(default_factory=ScaleSettings)
    weight: float = 0.0
    squares: FloatArray = field(default_factory=lambda: np.zeros(6))

    @property
    def degrees_of_freedom(self) -> float:
        """Degrees of freedom of the errors, which follow Student's t while their scale is uncertain."""
        return self.settings.prior_poses + self.weight

    @property
    def factors(self) -> FloatArray:
        """Factors (6,) of the standard deviations in camera axes: right, down, forward, rotation about the same axes.

        The geometric mean of the belief. The harmonic mean of the squares is smaller and made the filter overconfident.
        Before the first pose the factor exceeds 1, by 15 % with the default prior, because the belief is skewed.
        """
        degrees = self.degrees_of_freedom
        # mean logarithm of an inverse gamma variable, up to second-order terms
        squared = (self.settings.prior_poses + self.squares) / (degrees - 1.0)
        return np.clip(np.sqrt(squared), self.settings.min_factor, self.settings.max_factor)

    def predicted(self) -> ErrorScale:
        """Return the belief predicted to the next pose."""
        retention = self.settings.retention
        return replace(self, weight=retention * self.weight, squares=retention * self.squares)

    def updated(self, squares: FloatArray) -> ErrorScale:
        """Return the belief updated with squared errors (6,), relative to the variance for a factor of 1."""
        return replace(self, weight=self.weight + 1.0, squares=self.squares + squares)
