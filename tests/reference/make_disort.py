"""Makes disort.csv: light that leaves the Earth's air, that of its sky and on the ground, by PythonicDISORT.

In an environment that has pythonicdisort 1.8, from the repository's root: ``python -m tests.reference.make_disort``,
again whenever the optical depths, profiles or phase functions of the air change.
"""

import csv
from itertools import pairwise, product
from pathlib import Path

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander
from PythonicDISORT.pydisort import pydisort
from PythonicDISORT.subroutines import interpolate

from flyaround.simulator.scene.illumination.atmosphere import mie_phase, rayleigh_phase
from tools.validation.rendering.air import AZIMUTHS_DEG, GROUNDS, SUNS_DEG, VIEWS_DEG, flat_air

STREAMS, MOMENTS = 32, 64
EDGES_M = np.concatenate([np.linspace(0, 12e3, 25), np.linspace(12e3, 100e3, 16)[1:]])[::-1]


def moments(phase):
    """Legendre coefficients of a phase function."""
    x, w = leggauss(400)
    return 2 * np.pi * (w * phase(x)) @ legvander(x, MOMENTS)


def layers(air, band):
    """Optical depth above the foot, single-scattering albedo and Legendre coefficients of each layer, from the top."""
    kinds = moments(rayleigh_phase), moments(lambda c: mie_phase(c, air.mie_g))
    depth, albedo, phase = [], [], []
    for high, low in pairwise(EDGES_M):
        z = np.linspace(low, high, 41)
        rayleigh, mie, ozone = (np.trapezoid(d, z) for d in air.density(z))
        parts = rayleigh * air.rayleigh_m[band], mie * air.mie_scattering_m[band]
        whole = parts[0] + mie * air.mie_extinction_m[band] + ozone * air.ozone_m[band]
        depth.append(max(whole, 1e-9))
        albedo.append(min(sum(parts) / whole, 1 - 1e-9))
        mixed = (parts[0] * kinds[0] + parts[1] * kinds[1]) / sum(parts)
        phase.append(np.where(np.abs(mixed) < 1e-9, 0.0, mixed))
    phase = np.array(phase)
    phase[:, 0] = 1.0
    return np.cumsum(depth), np.array(albedo), phase


def light(air, band, ground, sun_deg):
    """Radiance (views, azimuths) at the top, upward, and at the ground, downward [sr-1]; irradiance of the ground [1].

    All over the Sun's irradiance.
    """
    depth, albedo, phase = layers(air, band)
    _, _, falling, _, u = pydisort(
        depth, albedo, STREAMS, phase, np.cos(np.radians(sun_deg)), 1.0, 0.0, NLeg=STREAMS,
        f_arr=phase[:, STREAMS], NT_cor=True, BDRF_Fourier_modes=[ground] if ground else [],
    )  # fmt: skip
    at = interpolate(u, NT_cor="eval")
    mu, azimuth = np.cos(np.radians(VIEWS_DEG)), np.radians(AZIMUTHS_DEG)
    up, down = (
        np.asarray(at(way * mu, tau, azimuth)).reshape(len(mu), len(azimuth))
        for way, tau in ((1, 0.0), (-1, depth[-1]))
    )
    return up, down, float(sum(falling(depth[-1])))


def main():
    """Write one row per direction, and one per Sun and ground of what falls on the ground."""
    airs = [(flat_air("mono"), 0), *((flat_air("rgb"), band) for band in range(3))]
    directions = list(product(enumerate(VIEWS_DEG), enumerate(AZIMUTHS_DEG)))
    rows = {"up": [], "down": [], "ground": []}
    for g, s in product(GROUNDS, SUNS_DEG):
        up, down, falling = (
            np.stack(part, axis=-1) for part in zip(*(light(*a, g, s) for a in airs), strict=True)
        )
        for (i, view), (k, azimuth) in directions:
            rows["up"].append([g, s, view, azimuth, *up[i, k]])
            rows["down"].append([g, s, view, azimuth, *down[i, k]])
        rows["ground"].append([g, s, 0.0, 0.0, *falling])
    with (Path(__file__).parent / "disort.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            ["what", "ground", "sun_deg", "view_deg", "azimuth_deg", "panchromatic", "red", "green", "blue"]
        )
        for what, lines in rows.items():
            writer.writerows([what, *line[:4], *(f"{x:.6e}" for x in line[4:])] for line in lines)


if __name__ == "__main__":
    main()
