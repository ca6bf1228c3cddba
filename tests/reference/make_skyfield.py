"""Makes skyfield.csv: apparent Sun and Moon, and the Earth's orientation, by Skyfield with JPL's DE421.

Run in an environment that has skyfield 1.55 and skyfield-data 7.0: ``python tests/reference/make_skyfield.py``.
"""

import csv
from pathlib import Path

import numpy as np
import skyfield_data
from skyfield.api import Loader
from skyfield.framelib import itrs

N = 500
FIRST_JD, LAST_JD = 2451545.0, 2469807.5  # 2000 to 2050


def main():
    """Write one row per moment, evenly strewn."""
    load = Loader(skyfield_data.get_skyfield_data_path())
    bodies = load("de421.bsp")
    scale = load.timescale(builtin=True)
    days = np.sort(np.random.default_rng(4).uniform(FIRST_JD, LAST_JD, N))
    with (Path(__file__).parent / "skyfield.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        axes = ["x_m", "y_m", "z_m"]
        header = ["jd_tt", "jd_ut1"] + [f"{b}_{a}" for b in ("sun", "moon") for a in axes]
        writer.writerow(header + [f"itrs_from_gcrs_{i}{j}" for i in range(3) for j in range(3)])
        for jd in days:
            t = scale.tt_jd(jd)
            sky = [bodies["earth"].at(t).observe(bodies[b]).apparent().position.m for b in ("sun", "moon")]
            values = [f"{x:.3f}" for x in np.concatenate(sky)]
            turned = [f"{x:.12f}" for x in itrs.rotation_at(t).ravel()]
            writer.writerow([repr(float(jd)), repr(float(t.ut1)), *values, *turned])


if __name__ == "__main__":
    main()
