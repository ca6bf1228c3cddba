"""A detector's response to sunlight per band: spectrum, lens, quantum efficiency, white balance."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.world.constants import LIGHT_M_S

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from flyaround.simulator.camera.detector.optics import Optics
    from flyaround.simulator.camera.detector.sensor import Detector, Sensor
    from flyaround.simulator.runtime.arrays import FloatArray

PLANCK_J_S = 6.62607015e-34
"""Planck constant, exact in the SI."""
MONO_BAND_NM = (450.0, 750.0)
"""Limits of the panchromatic band."""
RGB_BANDS_NM = ((600.0, 700.0), (500.0, 600.0), (400.0, 500.0))
"""Limits of red, green and blue: thirds of 400 to 700 nm."""
SRGB_FROM_BANDS = ((0.610, 0.713, -0.323), (-0.055, 1.062, -0.007), (-0.003, -0.125, 1.128))
"""Colour matrix from white-balanced red, green and blue to linear sRGB (rows). Each row sums to one, which preserves
white and black level. Fitted to spectra of limb, twilight, grounds, paints and lamps by
`tools.validation.rendering.colours`.
"""

Curve = tuple[tuple[float, float], ...]
"""Fraction by wavelength: (wavelength [m], fraction) pairs; linear between them and zero beyond the ends."""

# Extraterrestrial solar spectral irradiance at 1 au, mean of each 50 nm interval from 400 nm [W m-2 nm-1].
# ASTM G173-03 (2012), Reference solar spectral irradiances, column "etr".
_SPECTRUM_START_NM, _SPECTRUM_STEP_NM = 400.0, 50.0
_SPECTRUM_W_M2_NM = np.array([1.734, 1.994, 1.872, 1.823, 1.677, 1.502, 1.343])


def limits_nm(bands: int) -> tuple[tuple[float, float], ...]:
    """Return the lower and upper limit of each of one or three bands [nm]."""
    return (MONO_BAND_NM,) if bands == 1 else RGB_BANDS_NM


def sun_irradiance_between_w_m2(low_nm: float, high_nm: float) -> float:
    """Return the solar irradiance between two wavelengths, at 1 au and normal incidence.

    Returns
    -------
    float
        Irradiance [W m-2]; the part of the interval outside 400 to 750 nm is left out.
    """
    edges = _SPECTRUM_START_NM + _SPECTRUM_STEP_NM * np.arange(len(_SPECTRUM_W_M2_NM) + 1)
    overlap = np.clip(np.minimum(edges[1:], high_nm) - np.maximum(edges[:-1], low_nm), 0, None)
    return float(overlap @ _SPECTRUM_W_M2_NM)


def electrons_per_joule(detector: Detector, optics: Optics, bands: int) -> FloatArray:
    """Return the electrons per joule of sunlight before the lens, for each band (n,) [e J-1].

    It is the integral over the band of spectral irradiance x transmission x quantum efficiency x wavelength / (h c),
    divided by the integral of spectral irradiance. Light of another colour is treated as sunlight.
    """
    return np.array(
        _electrons_per_joule(
            detector.quantum_efficiency,
            detector.quantum_efficiency_curve,
            optics.transmission,
            optics.transmission_curve,
            bands,
        )
    )


@lru_cache(maxsize=32)
def _electrons_per_joule(
    efficiency: tuple[float, ...], efficiency_curve: Curve, share: float, share_curve: Curve, bands: int
) -> tuple[float, ...]:
    limits = limits_nm(bands)
    efficiency_by_band = (
        [float(np.mean(efficiency))] if bands == 1 else np.resize(np.array(efficiency), bands)
    )
    by_band = []
    for (low_nm, high_nm), number in zip(limits, efficiency_by_band, strict=True):
        wavelength_nm = np.arange(low_nm, high_nm) + 0.5
        spectrum = _SPECTRUM_W_M2_NM[((wavelength_nm - _SPECTRUM_START_NM) // _SPECTRUM_STEP_NM).astype(int)]
        response = sample_curve(efficiency_curve, wavelength_nm, number)
        transmission = share * sample_curve(share_curve, wavelength_nm, 1.0)
        photons = spectrum * wavelength_nm * 1e-9 / (PLANCK_J_S * LIGHT_M_S)
        by_band.append(float(photons @ (response * transmission) / spectrum.sum()))
    return tuple(by_band)


def sample_curve(
    curve: Sequence[tuple[float, float]], wavelength_nm: FloatArray, default: float
) -> FloatArray:
    """Interpolate a curve at wavelengths (K,); zero beyond its ends, and ``default`` everywhere if it is empty."""
    if not curve:
        return np.full(len(wavelength_nm), default)
    wavelength_m, share = np.array(curve).T
    return np.asarray(np.interp(wavelength_nm * 1e-9, wavelength_m, share, left=0.0, right=0.0))


def electrons_per_radiance(sensor: Sensor, optics: Optics, exposure_s: float, bands: int) -> FloatArray:
    """Return the electrons that unit radiance of each band releases in an image pixel on the axis.

    The irradiance behind an aplanatic lens is pi / (4 N^2) of the radiance; Born & Wolf (1999), section 4.8.

    Returns
    -------
    (n,) array
        Electrons per radiance during the exposure [e / (W m-2 sr-1)], in the order of the bands.

    Raises
    ------
    ValueError
        If the sensor counts no electrons.
    """
    d = sensor.electron_detector
    energy = np.pi / (4 * optics.f_number**2) * sensor.pixel_pitch_x_m * sensor.pixel_pitch_y_m * exposure_s
    return energy * electrons_per_joule(d, optics, bands)


def white_balance(sensor: Sensor, optics: Optics, sunlight: ArrayLike) -> FloatArray:
    """Return the factors (n,) on a detector's bands that render a white plate in sunlight grey; the smallest is 1.

    Parameters
    ----------
    sensor : Sensor
        Sensor with a detector.
    optics : Optics
        Optics of the lens.
    sunlight : array_like
        (n,) inverse of the Sun's irradiance in each band, up to a common factor.

    Returns
    -------
    (n,) array
        Factors, at least 1.

    Raises
    ------
    ValueError
        If the sensor counts no electrons.
    """
    target = np.asarray(sunlight, float)
    electrons = electrons_per_joule(sensor.electron_detector, optics, target.size)
    has_signal = electrons > 0  # channels without signal cannot be balanced
    gain = np.divide(target, electrons, out=np.full(target.size, np.inf), where=has_signal)
    return np.where(has_signal, gain / gain.min(), 1.0)
