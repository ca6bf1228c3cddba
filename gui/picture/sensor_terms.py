"""The parameters of a sensor that an operator may change, their names, and the histogram of a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui.picture.view_settings import changed_sensor
from flyaround.gui.texts import texts, with_titles
from flyaround.simulator.camera.detector.limits import sensor_problem
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.runtime.arrays import IntArray

OF_EVERY_SENSOR = frozenset({"blur_sigma_px", "bits"})
TERMS = texts("sensor")
"""Title with unit, and effect of a change, of each number of a sensor."""
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
    holder = sensor.detector or sensor
    return tuple(
        SensorTerm(name, text, effect, float(getattr(holder if hasattr(holder, name) else sensor, name)))
        for name, (text, effect) in TERMS.items()
        if hasattr(holder, name) or name in OF_EVERY_SENSOR
    )


def checked_change(sensor: Sensor, changes: dict[str, float], name: str, text: str) -> dict[str, float]:
    """Return the changes with one more, after checking it.

    Raises
    ------
    UserError
        If the sensor has no such parameter, or the value is not allowed.
    """
    titles = {term.name: term.text for term in terms_of(sensor)}
    if name not in titles:
        raise UserError(f"this sensor has no {name[:60]}; it has {', '.join(titles)}")
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UserError(f"{titles[name]} is '{text}', allowed: a number")
    new_changes = {**changes, name: value}
    problem = sensor_problem(changed_sensor(sensor, new_changes))
    if problem is not None:
        raise UserError(with_titles(problem))
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
