"""Named noise recipes of public data sets."""

from __future__ import annotations

from simulator.camera.sensor import Sensor
from simulator.errors import UserError

_PRESETS = {
    # Kisantal et al. (2020), Satellite Pose Estimation Challenge, IEEE TAES 56(5): blur 1 px, variance 0.0022
    "speed": Sensor(preset="speed", blur_sigma_px=1.0, speckle_variance=0.0, gaussian_variance=0.0022),
    # the recipe of the SVD thesis: speckle 0.004, then Gaussian 0.003
    "thesis": Sensor(preset="thesis", blur_sigma_px=1.0, speckle_variance=0.004, gaussian_variance=0.003),
    "ideal": Sensor(preset="ideal", blur_sigma_px=0.0, speckle_variance=0.0, gaussian_variance=0.0),
}


def list_sensor_presets() -> tuple[str, ...]:
    """Names of the built-in recipes."""
    return tuple(_PRESETS)


def sensor_preset(name: str) -> Sensor:
    """The recipe called ``name``.

    Raises
    ------
    UserError
        If there is none of that name.
    """
    if name not in _PRESETS:
        raise UserError(f"there is no sensor preset {name!r}: choose one of {', '.join(_PRESETS)}")
    return _PRESETS[name]
