"""Makes assets/earth_orientation/eop.npz from the IERS tables in the PyPI package astropy-iers-data.

Run with that package and pyerfa installed: ``python make_earth_parameters.py OUT.npz``.
"""

import sys
from importlib.resources import files

import erfa
import numpy as np

FIRST_MJD = 41317  # 1972-01-01


def rows():
    """UT1-UTC [s], x and y of the pole [arcsec] at 0 h UTC of each day: C04, continued by finals2000A."""
    data = files("astropy_iers_data") / "data"
    table: dict[int, tuple[float, float, float]] = {}
    for line in (data / "finals2000A.all").read_text().splitlines():
        if line[58:68].strip():
            table[round(float(line[7:15]))] = (float(line[58:68]), float(line[18:27]), float(line[37:46]))
    for line in (data / "eopc04.1962-now").read_text().splitlines():
        if not line.startswith("#"):
            mjd, x, y, ut1_utc = (float(word) for word in line.split()[4:8])
            table[round(mjd)] = (ut1_utc, x, y)
    return table


def main(out):
    """Write the table as whole microseconds and tens of microarcseconds, which pack well."""
    table = rows()
    last = max(table)
    days = np.arange(FIRST_MJD, last + 1)
    values = np.array([table[int(day)] for day in days])
    year, month, day, fraction = erfa.jd2cal(2400000.5, days.astype(float))
    ut1_tai_s = values[:, 0] - erfa.dat(year, month, day, fraction)
    np.savez_compressed(
        out,
        first_mjd=FIRST_MJD,
        ut1_minus_tai_us=np.round(ut1_tai_s * 1e6).astype(np.int32),
        pole_10_uas=np.round(values[:, 1:] * 1e5).astype(np.int32),
    )


if __name__ == "__main__":
    main(sys.argv[1])
