"""The numbers of a sensor that an operator may change, what they are called, and the histogram of a picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gui.picture.view_settings import changed_sensor
from simulator.camera.detector.limits import sensor_problem
from simulator.errors import UserError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from simulator.camera.detector.sensor import Sensor
    from simulator.runtime.arrays import IntArray

RECIPE: tuple[tuple[str, str], ...] = (
    ("blur_sigma_px", "blur, sigma [px]"),
    ("gaussian_variance", "additive noise, variance [1]"),
    ("speckle_variance", "multiplicative noise, variance [1]"),
    ("full_scale_j_m2_sr", "full scale [J/m2 sr]"),
    ("bits", "depth [bit]"),
)
DETECTOR: tuple[tuple[str, str], ...] = (
    ("blur_sigma_px", "blur, sigma [px]"),
    ("gain_e_per_dn", "gain [e/DN]"),
    ("black_level_dn", "black level [DN]"),
    ("full_well_e", "full well [e]"),
    ("read_noise_e", "read noise [e]"),
    ("row_noise_e", "row noise [e]"),
    ("column_noise_e", "column noise [e]"),
    ("dark_current_e_s", "dark current [e/s]"),
    ("temperature_c", "temperature [°C]"),
    ("dsnu_e", "dark offsets, DSNU [e]"),
    ("dark_nonuniformity", "dark current's spread [1]"),
    ("prnu", "response's spread, PRNU [1]"),
    ("hot_pixel_share", "hot pixels [share]"),
    ("hot_pixel_e_s", "hot pixels' current [e/s]"),
    ("dead_pixel_share", "dead pixels [share]"),
    ("cosmic_rays_cm2_s", "particles [1/cm2 s]"),
    ("blooming", "blooming [share]"),
    ("bits", "depth [bit]"),
)
BINS = 128


@dataclass(frozen=True, eq=False)
class Histogram:
    """How often each level is in a picture.

    Parameters
    ----------
    counts : (bands, BINS) pixels. width_dn : levels of a bin.
    saturated : share of the values at the top. median_dn, least_dn, most_dn : of all values.
    """

    counts: IntArray
    width_dn: float
    saturated: float
    median_dn: float
    least_dn: int
    most_dn: int


def terms_of(sensor: Sensor) -> tuple[tuple[str, str, float], ...]:
    """Field, what it is, and value of each number of a sensor."""
    rows = RECIPE if sensor.detector is None else DETECTOR
    return tuple((name, text, float(_value(sensor, name))) for name, text in rows)


def _value(sensor: Sensor, name: str) -> float:
    if sensor.detector is not None and hasattr(sensor.detector, name):
        return float(getattr(sensor.detector, name))
    return float(getattr(sensor, name))


def checked_change(sensor: Sensor, changes: dict[str, float], name: str, value: float) -> dict[str, float]:
    """The changes with one more.

    Raises
    ------
    UserError
        If the sensor has no such number, or it may not be that.
    """
    known = [field for field, _, _ in terms_of(sensor)]
    if name not in known:
        raise UserError(f"this sensor has no {name[:60]}; it has {', '.join(known)}")
    wanted = {**changes, name: value}
    problem = sensor_problem(changed_sensor(sensor, wanted))
    if problem is not None:
        raise UserError(problem)
    return wanted


def histogram_of(image: NDArray[np.unsignedinteger], bits: int) -> Histogram:
    """The histogram of (H, W) or (H, W, bands) digital numbers."""
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
