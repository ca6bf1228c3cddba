"""Light of stars by magnitude and colour: Hp to V, and V to irradiance in the camera's bands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.scene.illumination.bands import bands_of

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.bands import Bands

SUN_V_MAG = -26.76  # Willmer (2018), ApJS 236, 47, Vega system

# Hp - V of B to G stars of the main sequence and K giants over B-V: Bessell (2000), PASP 112, 961, table 2, every
# second row; bluer than its first row (B-V -0.219) along its first slope.
_BV_MAG = np.array([
    -0.350, -0.219, -0.139, -0.048, 0.040, 0.130, 0.227, 0.325, 0.420, 0.505, 0.590, 0.674, 0.756, 0.837,
    0.919, 0.996, 1.072, 1.151, 1.228, 1.305, 1.384, 1.462, 1.541, 1.619,
])  # fmt: skip
_HP_MINUS_V_MAG = np.array([
    -0.115, -0.066, -0.036, -0.006, 0.025, 0.048, 0.069, 0.087, 0.101, 0.114, 0.127, 0.134, 0.142, 0.151,
    0.158, 0.160, 0.164, 0.166, 0.164, 0.157, 0.148, 0.137, 0.125, 0.112,
])  # fmt: skip

# The same for M stars over V-I (Cousins), because their B-V is nearly constant: the passbands of Bessell (1990, PASP
# 102, 1181;
# 2000, table 3) on the spectra of Pickles (1998), PASP 110, 863, zero point of the table above. Up to 0.03 mag off.
_M_FROM_VI_MAG = 1.7
_M_FROM_BV_MAG = 0.9  # least B-V of M stars; Miras like Mira itself (0.97) reach it at maximum
_M_VI_MAG = np.array([1.7, 2.0, 2.5, 3.0, 3.5, 4.0, 4.4])
_M_HP_MINUS_V_MAG = np.array([0.127, 0.094, 0.020, -0.093, -0.223, -0.392, -0.520])

# Light in a band at equal V, over that of the Sun's colour: the 131 spectra of Pickles (1998) and Bessell's V passband.
# Of single stars the spectra are 1 % off in the panchromatic band (4 % at most), 2 % in the others (11 % at most).
_VI_MAG = np.array([-0.35, 0.0, 0.2, 0.4, 0.7, 1.0, 1.4, 1.7, 2.0, 2.5, 3.0, 3.5, 4.0, 4.4])
_BY_VI = {
    "panchromatic": np.array([
        0.930, 0.936, 0.941, 0.964, 1.000, 1.060, 1.159, 1.217, 1.280, 1.411, 1.613, 1.844, 2.189, 2.429,
    ]),
    "red": np.array([
        0.604, 0.707, 0.774, 0.855, 1.000, 1.164, 1.423, 1.491, 1.580, 1.665, 1.751, 1.936, 2.190, 2.442,
    ]),
    "green": np.array([
        1.003, 1.005, 1.007, 1.004, 1.000, 0.995, 0.987, 0.982, 0.971, 0.965, 0.954, 0.954, 0.931, 0.908,
    ]),
}  # fmt: skip
# The blue band depends on B-V alone; the other bands over V-I stand above.
_BLUE_BV_MAG = np.array([-0.35, -0.1, 0.0, 0.2, 0.4, 0.65, 0.9, 1.1, 1.4, 1.7])
_BLUE = np.array([2.184, 1.803, 1.681, 1.420, 1.196, 1.000, 0.804, 0.643, 0.522, 0.366])

# Photons per joule in the panchromatic band over those of sunlight, of the same spectra (0.9 % off at most)
_PHOTONS = np.array([
    0.938, 0.957, 0.970, 0.981, 1.000, 1.019, 1.044, 1.054, 1.064, 1.082, 1.102, 1.120, 1.137, 1.143,
])  # fmt: skip

# V-I of normal stars and of reflected sunlight over B-V; the Sun's own: Ramirez et al. (2012), ApJ 752, 5
_TYPICAL_BV_MAG = np.array([-0.35, 0.0, 0.3, 0.65, 0.95, 1.2, 1.45])
_TYPICAL_VI_MAG = np.array([-0.35, 0.0, 0.34, 0.70, 0.98, 1.25, 1.60])


def typical_v_minus_i(b_minus_v: FloatArray) -> FloatArray:
    """Return the typical V-I (Cousins) for a B-V, for reflected sunlight and for stars other than class M.

    Returns
    -------
    (K,) array
        V-I [mag]; beyond the ends of the table, at B-V of -0.35 and 1.45, the value there.
    """
    return np.asarray(np.interp(b_minus_v, _TYPICAL_BV_MAG, _TYPICAL_VI_MAG))


def plausible_v_minus_i(b_minus_v: FloatArray, v_minus_i: FloatArray) -> FloatArray:
    """Return the catalogue's V-I (K,), replaced by the typical value where it is missing or implausible for B-V."""
    blue = (np.asarray(v_minus_i) > _M_FROM_VI_MAG) & (np.asarray(b_minus_v) < _M_FROM_BV_MAG)
    return np.where(np.isfinite(v_minus_i) & ~blue, v_minus_i, typical_v_minus_i(b_minus_v))


def hp_minus_v(b_minus_v: FloatArray, v_minus_i: FloatArray) -> FloatArray:
    """Return the Hipparcos magnitude minus Johnson V (K,) of stars of colours B-V and V-I."""
    by_bv = np.interp(b_minus_v, _BV_MAG, _HP_MINUS_V_MAG)
    by_vi = np.interp(v_minus_i, _M_VI_MAG, _M_HP_MINUS_V_MAG)
    return np.where(np.asarray(v_minus_i) > _M_FROM_VI_MAG, by_vi, by_bv)


def photons_over_sunlights(v_minus_i: FloatArray, bands: Bands) -> FloatArray:
    """Return photons per joule of starlight over those of sunlight, per band.

    Returns
    -------
    (K, n) array
        Ratios in the order of the stars and of the image's channels; ones for colour bands, in which they are nearly
        one.
    """
    n = len(bands_of(bands))
    if n > 1:
        return np.ones((len(v_minus_i), n))
    return np.interp(v_minus_i, _VI_MAG, _PHOTONS)[:, None]


def irradiance_of_v_mag(
    v_mag: FloatArray, b_minus_v: FloatArray, v_minus_i: FloatArray, bands: Bands
) -> FloatArray:
    """Return the irradiance of stars of Johnson magnitude V and colours B-V and V-I, per band.

    A star of the Sun's colours has the Sun's irradiance, scaled by the difference in magnitude.

    Returns
    -------
    (K, n) array
        Irradiance [W m-2], in the order of the stars and of the image's channels.
    """
    dimmed = 10 ** (-0.4 * (np.asarray(v_mag, float) - SUN_V_MAG))
    columns = []
    for band in bands_of(bands):
        if band.name == "blue":
            colour = np.interp(b_minus_v, _BLUE_BV_MAG, _BLUE)
        else:
            colour = np.interp(v_minus_i, _VI_MAG, _BY_VI[band.name])
        columns.append(band.sun_irradiance_w_m2 * dimmed * colour)
    return np.stack(columns, axis=-1)
