"""Weights of robust estimators, which bound the influence of outliers."""

import numpy as np

Array = np.ndarray


def geman_mcclure(weight: Array, residual: Array, scale: float) -> Array:
    """Return weights multiplied by those of the Geman-McClure cost, bounded by ``scale**2 / 2`` per residual.

    Parameters
    ----------
    weight : array
        Initial weights.
    residual : array
        Residuals.
    scale : float
        Scale of the cost, in the unit of the residuals.

    References
    ----------
    Geman & McClure (1987), Statistical methods for tomographic image reconstruction, Bull. ISI 52:
    rho = r^2 / 2 / (1 + r^2 / s^2); the weight is its derivative divided by r.
    """
    return weight / (1 + (residual / scale) ** 2) ** 2


def tukey(residual: Array, limit: float) -> Array:
    """Return Tukey's biweight: 1 at zero, 0 from ``limit`` on.

    References
    ----------
    Beaton & Tukey (1974), Technometrics 16: rho = c^2 / 6 (1 - (1 - r^2 / c^2)^3); the weight is rho' / r.
    """
    return np.asarray(np.clip(1 - (residual / limit) ** 2, 0, None) ** 2)
