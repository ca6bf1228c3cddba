"""Makes astropy.csv: the rotation from GCRS to ITRS by astropy, at moments from 1973 to 2026.

astropy (8.0.2) is handed the same table of UT1 and pole as this package ships, so that what is compared is the chain
from UTC over TT and UT1 to the matrix. Run in an environment that has astropy, from the repository's root:
``python tests/reference/make_astropy.py``.
"""

import csv
from pathlib import Path

import astropy.units as u
import numpy as np
from astropy.coordinates import GCRS, ITRS, CartesianRepresentation
from astropy.table import QTable
from astropy.time import Time
from astropy.utils import iers

ROOT = Path(__file__).parents[2]
COUNT = 24


def shipped_table():
    """The package's table as astropy takes one."""
    data = np.load(ROOT / "assets" / "earth_orientation" / "eop.npz")
    first = float(data["first_mjd"])
    mjd = first + np.arange(len(data["ut1_minus_tai_us"]))
    days = Time(mjd, format="mjd", scale="utc")
    tai_minus_utc = np.array([round((d.tai.mjd - d.mjd) * 86400) for d in days])
    pole = data["pole_10_uas"] * 1e-5
    return iers.IERS(
        QTable(
            {
                "MJD": mjd * u.d,
                "UT1_UTC": (data["ut1_minus_tai_us"] * 1e-6 + tai_minus_utc) * u.s,
                "PM_x": pole[:, 0] * u.arcsec,
                "PM_y": pole[:, 1] * u.arcsec,
            }
        )
    )


def main():
    """Rotate the axes and write."""
    rng = np.random.default_rng(7)
    times = Time(np.sort(rng.uniform(41700.0, 61300.0, COUNT)), format="mjd", scale="utc")
    times = Time([t.isot for t in times], scale="utc")
    rows = []
    with iers.earth_orientation_table.set(shipped_table()):
        for t in times:
            axes = CartesianRepresentation(np.eye(3) * 1e9 * u.m)
            turned = GCRS(axes, obstime=t).transform_to(ITRS(obstime=t)).cartesian.xyz.to_value(u.m) / 1e9
            rows.append([f"{t.isot}Z", *(f"{x:.17g}" for x in turned.ravel())])
    with (Path(__file__).parent / "astropy.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["epoch_utc", *(f"R{i}{j}" for i in range(3) for j in range(3))])
        writer.writerows(rows)


if __name__ == "__main__":
    main()
