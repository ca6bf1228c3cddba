"""The parameters of a sensor that an operator may change, their names, and the histogram of a picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui.picture.view_settings import changed_sensor
from flyaround.simulator.camera.detector.limits import sensor_problem
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.runtime.arrays import IntArray

BLUR = ("blur_sigma_px", "blur, sigma [px]", "width of the blur; more makes edges softer")
DEPTH = ("bits", "depth [bit]", "bits of a level; fewer make visible steps")
RECIPE: tuple[tuple[str, str, str], ...] = (
    BLUR,
    ("gaussian_variance", "additive noise, variance [1]", "more makes the picture grainier in dark parts"),
    ("speckle_variance", "multiplicative noise, variance [1]", "more makes it grainier in bright parts"),
    ("full_scale_j_m2_sr", "full scale [J/m2 sr]", "exposure of a white pixel; more makes it darker"),
    DEPTH,
)
DETECTOR: tuple[tuple[str, str, str], ...] = (
    BLUR,
    ("gain_e_per_dn", "gain [e/DN]", "electrons per level; more makes the picture darker"),
    ("black_level_dn", "black level [DN]", "level of a pixel without light; more lifts the dark parts"),
    ("full_well_e", "full well [e]", "electrons that a pixel holds; fewer saturate sooner"),
    ("read_noise_e", "read noise [e]", "noise of each read-out; more makes dark parts grainier"),
    ("row_noise_e", "row noise [e]", "noise common to a row; more draws horizontal lines"),
    ("column_noise_e", "column noise [e]", "noise common to a column; more draws vertical lines"),
    (
        "dark_current_e_s",
        "dark current [e/s]",
        "signal without light at the reference temperature; more brightens long exposures",
    ),
    ("temperature_c", "temperature [°C]", "temperature of the detector; more raises the dark current"),
    ("dsnu_e", "dark offsets, DSNU [e]", "differences between pixels in the dark; more makes a fixed grain"),
    (
        "dark_nonuniformity",
        "dark current's spread [1]",
        "differences between dark currents; more makes grain in long exposures",
    ),
    ("prnu", "response's spread, PRNU [1]", "differences in sensitivity; more makes grain in bright parts"),
    ("hot_pixel_share", "hot pixels [share]", "pixels with far more dark current: bright dots"),
    ("hot_pixel_e_s", "hot pixels' current [e/s]", "dark current of each hot pixel; more makes it brighter"),
    ("dead_pixel_share", "dead pixels [share]", "pixels without signal: dark dots"),
    ("cosmic_rays_cm2_s", "particles [1/cm2 s]", "particles on the detector; more leave more tracks"),
    ("blooming", "blooming [share]", "share of a full pixel's surplus that spills along its column: streaks"),
    DEPTH,
)
"""Field, name with unit, and effect of a change."""
BINS = 128  # bins of the histogram


@dataclass(frozen=True)
class SensorTerm:
    """A parameter of a sensor.

    Parameters
    ----------
    name : str
        Field of the sensor.
    text : str
        Name for people, with unit.
    effect : str
        Effect of a change.
    value : float
        Present value.
    """

    name: str
    text: str
    effect: str
    value: float


@dataclass(frozen=True, eq=False)
class Histogram:
    """Histogram of a picture's levels.

    Parameters
    ----------
    counts : IntArray
        (bands, BINS) number of pixels.
    width_dn : float
        Width of a bin.
    saturated : float
        Share of the values at full scale.
    median_dn : float
        Median and extremes of all values.
    least_dn : int
        Median and extremes of all values.
    most_dn : int
        Median and extremes of all values.
    """

    counts: IntArray
    width_dn: float
    saturated: float
    median_dn: float
    least_dn: int
    most_dn: int


def terms_of(sensor: Sensor) -> tuple[SensorTerm, ...]:
    """Return the parameters of a sensor."""
    rows = RECIPE if sensor.detector is None else DETECTOR
    return tuple(SensorTerm(name, text, effect, _value(sensor, name)) for name, text, effect in rows)


def _value(sensor: Sensor, name: str) -> float:
    if sensor.detector is not None and hasattr(sensor.detector, name):
        return float(getattr(sensor.detector, name))
    return float(getattr(sensor, name))


def checked_change(sensor: Sensor, changes: dict[str, float], name: str, value: float) -> dict[str, float]:
    """Return the changes with one more, after checking it.

    Raises
    ------
    UserError
        If the sensor has no such parameter, or the value is not allowed.
    """
    names = [term.name for term in terms_of(sensor)]
    if name not in names:
        raise UserError(f"this sensor has no {name[:60]}; it has {', '.join(names)}")
    new_changes = {**changes, name: value}
    problem = sensor_problem(changed_sensor(sensor, new_changes))
    if problem is not None:
        raise UserError(problem)
    return new_changes


def histogram_of(image: NDArray[np.unsignedinteger], bits: int) -> Histogram:
    """Return the histogram of (H, W) or (H, W, bands) digital numbers."""
    full = 2**bits
    values = image.reshape(-1, 1) if image.ndim == 2 else image.reshape(-1, image.shape[2])
    by_level = np.stack([np.bincount(band, minlength=full)[:full] for band in values.T])
    total = by_level.sum(axis=0)
    present = np.flatnonzero(total)
    running = np.cumsum(total)
    return Histogram(
        counts=by_level.reshape(len(by_level), BINS, -1).sum(axis=2),
        width_dn=full / BINS,
        saturated=float(total[-1] / max(running[-1], 1)),
        median_dn=float(np.searchsorted(running, running[-1] / 2)),
        least_dn=int(present[0]) if len(present) else 0,
        most_dn=int(present[-1]) if len(present) else 0,
    )
