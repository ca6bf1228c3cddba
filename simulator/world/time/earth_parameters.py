"""Measured Earth orientation parameters of the IERS: daily values of UT1 and the pole."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray

_ARCSEC_RAD = np.pi / 648_000


@dataclass(frozen=True, eq=False)
class EarthParameters:
    """Table of Earth orientation parameters, with one row per day at 0 h UTC.

    Before and after the table, the first and last row apply. The error of UT1 then grows by up to half a second per
    year, because the length of the day cannot be predicted, and that of the pole is up to 0.5 arcsec.

    Parameters
    ----------
    first_mjd : float
        Modified Julian date of the first row.
    ut1_minus_tai_s : (n,) array
        UT1 - TAI [s]; relative to TAI, so that leap seconds cause no steps.
    pole_rad : (n, 2) array
        x and y of the pole [rad].
    """

    first_mjd: float
    ut1_minus_tai_s: FloatArray
    pole_rad: FloatArray

    def _row(self, mjd: float) -> tuple[int, float]:
        row = min(max(mjd - self.first_mjd, 0.0), len(self.ut1_minus_tai_s) - 1.000001)
        return int(row), row - int(row)

    def ut1_minus_tai(self, mjd: float) -> float:
        """Return UT1 - TAI [s], linear between rows (0.02 ms)."""
        k, f = self._row(mjd)
        a, b = self.ut1_minus_tai_s[k : k + 2]
        return float(a + f * (b - a))

    def pole(self, mjd: float) -> tuple[float, float]:
        """Return the coordinates of the pole in ITRS [rad]."""
        k, f = self._row(mjd)
        x, y = self.pole_rad[k] + f * (self.pole_rad[k + 1] - self.pole_rad[k])
        return float(x), float(y)

    def covers(self, mjd: float) -> bool:
        """Return True if the day is in the table."""
        return 0 <= mjd - self.first_mjd <= len(self.ut1_minus_tai_s) - 1


@lru_cache(maxsize=1)
def earth_parameters() -> EarthParameters:
    """Return the shipped table: IERS 20 C04 from 1972 on, then Bulletin A's measurements and a year of predictions."""
    source = files("flyaround.assets").joinpath("earth_orientation", "eop.npz")
    with source.open("rb") as file, np.load(file) as data:
        return EarthParameters(
            first_mjd=float(data["first_mjd"]),
            ut1_minus_tai_s=data["ut1_minus_tai_us"] * 1e-6,
            pole_rad=data["pole_10_uas"] * (1e-5 * _ARCSEC_RAD),
        )
