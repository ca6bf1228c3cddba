"""Rows of the rendering page on colour: three bands against complete spectra, and perceived colours."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.detector.response import (
    RGB_BANDS_NM,
    SRGB_FROM_BANDS,
    sun_irradiance_between_w_m2,
)
from flyaround.simulator.scene.illumination.atmosphere import (
    earth_atmosphere,
    mie_phase,
    path_light,
    rayleigh_phase,
)
from flyaround.simulator.scene.illumination.multiple_scattering import multiple_scattering
from flyaround.simulator.world.bodies.earth import EARTH
from flyaround.simulator.world.ephemeris.body import BodyAir
from tools.validation.rows import Row

if TYPE_CHECKING:
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.atmosphere import Atmosphere

NM = np.arange(405.0, 700.0, 10.0)  # wavelengths
# heights of the path's lowest point
HEIGHTS_M = 1e3 * np.array([1.0, 3.0, 5.0, 8.0, 10.0, 12.0, 15.0, 18.0, 20.0, 25.0, 30.0, 40.0])
SUNS_DEG = ((80, 0), (60, 90), (30, 90), (10, 180), (5, 0), (2, 0), (0, 0), (-3, 0))
"""Elevation of the Sun at the tangent point, and azimuth from the line of sight."""
# absorption by 1 cm of ozone: Leckner (1978), in Bird & Riordan (1986), table 1
OZONE_NM = (
    400,
    430,
    440,
    450,
    460,
    470,
    480,
    490,
    500,
    510,
    520,
    530,
    540,
    550,
    570,
    593,
    610,
    630,
    656,
    668,
    690,
    710,
)
# unit: 1e-3
OZONE_PER_CM = (
    0,
    0,
    1,
    3,
    6,
    9,
    14,
    21,
    30,
    40,
    48,
    63,
    75,
    85,
    120,
    119,
    120,
    90,
    65,
    51,
    28,
    18,
)
# rounded reflectance at 400, 450, 500, 550, 600, 650 and 700 nm: white plate, sand, soil, leaves, sea
GROUNDS = np.array(
    [
        [1, 1, 1, 1, 1, 1, 1],
        [0.12, 0.16, 0.20, 0.28, 0.35, 0.39, 0.42],
        [0.04, 0.06, 0.08, 0.11, 0.15, 0.18, 0.20],
        [0.03, 0.04, 0.05, 0.10, 0.06, 0.05, 0.10],
        [0.05, 0.045, 0.03, 0.012, 0.004, 0.003, 0.002],
    ]
)
# pigments absorb below an edge: wavelength and width [nm] of the edge, reflectance on either side
PAINTS = (
    (610.0, 12.0, 0.05, 0.7),
    (575.0, 15.0, 0.05, 0.7),
    (520.0, 15.0, 0.06, 0.75),
    (510.0, 25.0, 0.1, 0.85),  # Kapton on aluminium
    (500.0, 12.0, 0.45, 0.05),
)
LAMPS_K = (2000.0, 4000.0)
"""Temperatures of black bodies with the colours of sodium and white lamps."""
MAN_MADE = len(PAINTS) + len(LAMPS_K)
MAN_MADE_WEIGHT = 2.0
"""Maximum integer weight of these few colours among about a hundred limbs that keeps the limbs within their goal."""
# CIE 1931 by Wyman, Sloan & Shirley (2013), J. Comput. Graph. Tech. 2(2): height, middle [nm], widths below and above
LOBES = (
    ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2)),
    ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1)),
    ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8)),
)
D65 = np.array([0.9505, 1.0, 1.089])  # white point, CIE XYZ (IEC 61966-2-1)
SRGB_FROM_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.204, 1.057]])
NOTES = """
Limbs from 400 km at eight heights of the Sun, from noon to dusk: our three bands beside the same air at 30
wavelengths, averaged over each band. Bands of 100 nm are not the colours of a screen: shown as such, the limb looks
violet. `SRGB_FROM_BANDS` maps the bands, times `sunlight_balance`, to linear sRGB: the least squares over those
limbs, sand, soil, leaves, sea, paints and lamps (these count double). It keeps white.
"""


@dataclass(frozen=True, eq=False)
class Colours:
    """Light (K, 3) over a white plate's in sunlight: in our bands, in exact bands, and as linear sRGB."""

    ours: FloatArray
    exact: FloatArray
    srgb: FloatArray


def limbs(air: Atmosphere) -> FloatArray:
    """Return the (Suns * heights, n) radiance of the limb over the Sun's irradiance [sr-1]."""
    table = multiple_scattering(air)
    camera = np.array([-np.sqrt((air.radius_m + 400e3) ** 2 - air.radius_m**2), 0.0, air.radius_m])
    rays = np.stack([0 * HEIGHTS_M, 0 * HEIGHTS_M, air.radius_m + HEIGHTS_M], axis=1) - camera
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    up, azimuth = np.radians(SUNS_DEG).T
    suns = np.stack([np.cos(up) * np.cos(azimuth), np.cos(up) * np.sin(azimuth), np.sin(up)], axis=1)
    path = path_light(air, camera, rays, suns, steps=48, multiple=table)
    cosine = (suns @ rays.T)[..., None]
    light = path.rayleigh * rayleigh_phase(cosine) + path.mie * mie_phase(cosine, air.mie_g) + path.multiple
    return light.reshape(-1, light.shape[-1])


def colours() -> Colours:
    """Return the light of limbs, then of surfaces and lamps, whose bands are exact."""
    bands, own = earth_atmosphere("rgb"), EARTH.air or BodyAir(rayleigh_m_um4=0.0, rayleigh_height_m=1.0)
    um, (a, b) = NM * 1e-3, own.rayleigh_dispersion_um
    aerosol = own.aerosol_m * (um / 0.55) ** -own.aerosol_exponent
    spectral = replace(
        bands,
        rayleigh_m=own.rayleigh_m_um4 * (1 + a / um**2 + b / um**4) / um**4,
        mie_scattering_m=own.aerosol_albedo * aerosol,
        mie_extinction_m=aerosol,
        ozone_m=np.interp(NM, OZONE_NM, OZONE_PER_CM) * (1e-3 * 0.3 / 15_000.0),
    )
    sun = np.array([sun_irradiance_between_w_m2(nm - 5, nm + 5) for nm in NM])
    lamps = np.array([1 / (np.expm1(1.4388e7 / (NM * t)) * NM**5 * sun) for t in LAMPS_K])
    surfaces = [
        *(np.interp(NM, np.arange(400, 701, 50), g) for g in GROUNDS),
        *(low + (high - low) / (1 + np.exp((edge - NM) / width)) for edge, width, low, high in PAINTS),
        *(lamps / lamps.max(axis=1, keepdims=True)),
    ]
    spectra = np.concatenate([limbs(spectral), np.array(surfaces) / np.pi])
    exact = np.stack(
        [
            np.average(spectra[:, k], axis=1, weights=sun[k])
            for k in ((low < NM) & (high > NM) for low, high in RGB_BANDS_NM)
        ],
        axis=1,
    )
    eye = sun * [sum(_lobe(*lobe) for lobe in lobes) for lobes in LOBES]
    xyz = spectra @ eye.T / eye.sum(axis=1) * D65
    rendered = np.concatenate([limbs(bands), exact[-len(surfaces) :]])
    return Colours(np.pi * rendered, np.pi * exact, np.pi * xyz @ SRGB_FROM_XYZ.T)


def _lobe(height: float, middle: float, below: float, above: float) -> FloatArray:
    return height * np.exp(-0.5 * ((NM - middle) / np.where(middle > NM, below, above)) ** 2)


def fitted(light: Colours) -> FloatArray:
    """Return the (3, 3) least-squares matrix that preserves white, with errors relative to each colour's brightness."""
    weight = 1 / np.maximum(light.exact.sum(axis=1, keepdims=True), 1e-2)
    weight[-MAN_MADE:] *= MAN_MADE_WEIGHT
    red_green = (light.exact[:, :2] - light.exact[:, 2:]) * weight
    ab = np.linalg.lstsq(red_green, (light.srgb - light.exact[:, 2:]) * weight, rcond=None)[0].T
    return np.column_stack([ab, 1 - ab.sum(axis=1)])


def rows(renderer: Renderer | None = None) -> list[Row]:  # noqa: ARG001 - colour science alone; another row covers the rendering
    """Measure and return every comparison."""
    light = colours()
    brightness = light.exact.sum(axis=1, keepdims=True)
    difference = (light.ours @ np.transpose(SRGB_FROM_BANDS) - light.srgb) / brightness
    natural = np.flatnonzero(brightness[:-MAN_MADE] > 0.02)
    measured = (
        (
            "limb's light in three bands, over the sum of them, rms",
            0.03,
            ((light.ours - light.exact) / brightness)[natural],
        ),
        (
            "limbs and grounds as sRGB by `SRGB_FROM_BANDS`, over the sum, rms",
            0.04,
            difference[natural],
        ),
        ("paints and lamps as sRGB by `SRGB_FROM_BANDS`, over the sum, rms", 0.07, difference[-MAN_MADE:]),
    )
    return [
        Row(
            what=quantity,
            against=against,
            unit="1",
            goal=goal,
            measured=float(np.sqrt(np.mean(deviation**2))),
        )
        for (quantity, goal, deviation), against in zip(
            measured, ("30 wavelengths", *2 * ("CIE 1931 of 30 wavelengths",)), strict=True
        )
    ]
