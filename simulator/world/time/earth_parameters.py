"""Measured Earth orientation parameters of the IERS: daily values of UT1 and the pole."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray

_ARCSEC_RAD = np.pi / 648_000  # an arcsecond


@dataclass(frozen=True, eq=False)
class EarthParameters:
    """Table of Earth orientation parameters, with one row per day at 0 h UTC.

    Before and after the table, the first and last row apply. The error of UT1 grows after the table by up to half a
    second per year, because the length of the day cannot be predicted, and before 1972 by about one; that of the pole
    is up to 0.5 arcsec.

    Parameters
    ----------
    first_mjd : float
        Modified Julian date of the first row, UTC.
    ut1_minus_tai_s : (n,) array
        UT1 - TAI [s]; relative to TAI, so that leap seconds cause no steps.
    pole_rad : (n, 2) array
        x and y of the pole [rad].
    """

    first_mjd: float
    ut1_minus_tai_s: FloatArray
    pole_rad: FloatArray

    def _row(self, mjd_utc: float) -> tuple[int, float]:
        """Return the row before a time, and the fraction of the way to the next."""
        last = len(self.ut1_minus_tai_s) - 1
        row = min(max(mjd_utc - self.first_mjd, 0.0), last)
        k = min(int(row), last - 1)
        return k, row - k

    def compute_ut1_minus_tai_s(self, mjd_utc: float) -> float:
        """Return UT1 - TAI [s], linear between rows."""
        k, f = self._row(mjd_utc)
        a, b = self.ut1_minus_tai_s[k : k + 2]
        return float(a + f * (b - a))

    def compute_pole_rad(self, mjd_utc: float) -> tuple[float, float]:
        """Return the coordinates of the pole in ITRS [rad]."""
        k, f = self._row(mjd_utc)
        x, y = self.pole_rad[k] + f * (self.pole_rad[k + 1] - self.pole_rad[k])
        return float(x), float(y)

    def covers(self, mjd_utc: float) -> bool:
        """Return True if the day is in the table."""
        return 0 <= mjd_utc - self.first_mjd <= len(self.ut1_minus_tai_s) - 1


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
