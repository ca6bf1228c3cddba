"""Parameters of the sensor: a noise recipe on a 0..1 image, or a detector in electrons."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from flyaround.simulator.runtime.sections import bounded

ColourFilter = Literal["none", "rggb", "bggr", "grbg", "gbrg"]


@dataclass(frozen=True, kw_only=True)
class Detector:
    """Parameters of a detector, in electrons. Noise terms are standard deviations unless stated otherwise.

    Parameters
    ----------
    quantum_efficiency : tuple of float, optional
        Electrons per photon of sunlight, mean over the band: one number, or red, green, blue.
    quantum_efficiency_curve : tuple of tuple of float, optional
        Replaces it: (wavelength [m], electrons per photon) in ascending order, linear between and zero beyond; each
        band of a colour detector uses its interval.
    full_well_e : float, optional
        Full-well capacity [e].
    gain_e_per_dn : float, optional
        System gain [e DN-1].
    black_level_dn : float, optional
        Offset added to the signal.
    read_noise_e : float, optional
        Noise of each read-out.
    row_noise_e : float, optional
        Noise shared by the pixels of a row in one frame.
    column_noise_e : float, optional
        Noise shared by the pixels of a column in one frame.
    dark_current_e_s : float, optional
        Dark current at ``dark_reference_c``; it doubles every ``dark_doubling_c`` kelvin.
    dark_reference_c : float, optional
        Temperature at which the dark current is stated [deg C].
    dark_doubling_c : float, optional
        Temperature increase that doubles the dark current [K].
    temperature_c : float, optional
        Temperature of the detector.
    dsnu_e : float, optional
        Fixed offset of each pixel.
    dark_nonuniformity : float, optional
        Fixed relative variation of dark current.
    prnu : float, optional
        Fixed relative variation of sensitivity.
    hot_pixel_share : float, optional
        Share of pixels with additional dark current.
    hot_pixel_e_s : float, optional
        Mean of this additional dark current, which is exponentially distributed.
    dead_pixel_share : float, optional
        Share of pixels without signal.
    blooming : float, optional
        Share of the charge above the full well that spills into the column's neighbours.
    cosmic_rays_cm2_s : float, optional
        Rate of ionising particles. Each leaves 80 electrons per micrometre of its track in a layer of thickness
        ``layer_m``.
    layer_m : float, optional
        Thickness of the sensitive layer.
    colour_filter : ColourFilter, optional
        ``none`` (each pixel sees every band) or a Bayer mosaic, named by its first two by two pixels.
    demosaic : bool, optional
        True to output the interpolated RGB image instead of the mosaic.
    binning : int, optional
        Width and height of an image pixel in physical pixels.
    charge_binning : bool, optional
        True to add charges before read-out (one read noise), False to add numbers after it.
    roi_x0_px : int, optional
        Column of the image's first pixel on the detector, which selects its fixed pattern.
    roi_y0_px : int, optional
        Row of the image's first pixel on the detector.
    serial : int, optional
        Serial number of the device: seed of the fixed pattern, the same in every frame and scenario.
    shot_noise : bool, optional
        False only in clean twins, where all other noise is off too.
    """

    quantum_efficiency: tuple[float, ...] = (0.6,)
    quantum_efficiency_curve: tuple[tuple[float, float], ...] = ()
    full_well_e: float = bounded(10_000.0, 1.0, 1e9)
    gain_e_per_dn: float = bounded(40.0, 1e-4, 1e6)
    black_level_dn: float = bounded(0.0, 0.0, 60_000.0)
    read_noise_e: float = bounded(5.0, 0.0, 1e5)
    row_noise_e: float = bounded(0.0, 0.0, 1e5)
    column_noise_e: float = bounded(0.0, 0.0, 1e5)
    dark_current_e_s: float = bounded(0.0, 0.0, 1e9)
    dark_reference_c: float = bounded(20.0, -273.0, 200.0)
    dark_doubling_c: float = bounded(7.0, 1.0, 100.0)
    temperature_c: float = bounded(20.0, -273.0, 200.0)
    dsnu_e: float = bounded(0.0, 0.0, 1e6)
    dark_nonuniformity: float = bounded(0.0, 0.0, 1.0)
    prnu: float = bounded(0.0, 0.0, 0.5)
    hot_pixel_share: float = bounded(0.0, 0.0, 1.0)
    hot_pixel_e_s: float = bounded(0.0, 0.0, 1e9)
    dead_pixel_share: float = bounded(0.0, 0.0, 1.0)
    blooming: float = bounded(0.0, 0.0, 1.0)
    cosmic_rays_cm2_s: float = bounded(0.0, 0.0, 1e6)
    layer_m: float = bounded(5e-6, 1e-7, 1e-3)
    colour_filter: ColourFilter = "none"
    demosaic: bool = True
    binning: int = bounded(1, 1, 16)
    charge_binning: bool = False
    roi_x0_px: int = bounded(0, 0, 65_535)
    roi_y0_px: int = bounded(0, 0, 65_535)
    serial: int = bounded(0, 0, 2**31 - 1)
    shot_noise: bool = True

    @property
    def dark_e_s(self) -> float:
        """Dark current of a physical pixel at the detector's temperature [e s-1]."""
        return float(
            self.dark_current_e_s
            * 2.0 ** ((self.temperature_c - self.dark_reference_c) / self.dark_doubling_c)
        )

    @property
    def pixels_per_bin(self) -> int:
        """Number of physical pixels per image pixel."""
        return self.binning * self.binning

    @property
    def read_noise_per_pixel_e(self) -> float:
        """Read noise of an image pixel [e]; charge binned before the read-out is read once."""
        return self.read_noise_e if self.charge_binning else self.read_noise_e * self.binning


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """Detector and its noise recipe.

    Without ``detector`` the signal is 0..1 (1 = full scale) and the noise a recipe. With it, photons and electrons are
    counted, and ``full_scale_j_m2_sr``, ``speckle_variance`` and ``gaussian_variance`` are unused.

    Parameters
    ----------
    preset : str, optional
        Name of the recipe or of the built-in detector.
    full_scale_j_m2_sr : float, optional
        Radiance times exposure at full scale, per band [J m-2 sr-1].
    blur_sigma_px : float, optional
        Standard deviation of the Gaussian PSF [px].
    speckle_variance : float, optional
        Variance of the uniform multiplicative noise ``I + n I`` [1].
    gaussian_variance : float, optional
        Variance of the additive noise [1].
    bits : int, optional
        Bit depth of the written image.
    pixel_pitch_x_m : float, optional
        Horizontal distance of neighbouring image pixels on the detector [m].
    pixel_pitch_y_m : float, optional
        Vertical distance of neighbouring image pixels on the detector [m].
    detector : Detector, optional
        The detector in electrons, or None.
    """

    preset: str = "speed"
    full_scale_j_m2_sr: float = bounded(0.1, 1e-12, 1e6)
    blur_sigma_px: float = bounded(1.0, 0.0, 10.0)
    speckle_variance: float = bounded(0.0, 0.0, 1.0)
    gaussian_variance: float = bounded(0.0022, 0.0, 1.0)
    bits: int = bounded(8, 8, 16)
    pixel_pitch_x_m: float = bounded(5.86e-6, 1e-7, 1e-3)
    pixel_pitch_y_m: float = bounded(5.86e-6, 1e-7, 1e-3)
    detector: Detector | None = None

    @property
    def electron_detector(self) -> Detector:
        """The detector that counts electrons.

        Raises
        ------
        ValueError
            If the sensor has none.
        """
        if self.detector is None:
            raise ValueError("a noise recipe on a 0..1 image has no electrons")
        return self.detector

    @property
    def saturation_e(self) -> float:
        """Return the charge of an image pixel at saturation [e], of the full well or the converter.

        Raises
        ------
        ValueError
            If the sensor has no detector.
        """
        d = self.electron_detector
        converter = (2**self.bits - 1 - d.black_level_dn) * d.gain_e_per_dn
        return min(d.full_well_e * d.pixels_per_bin, converter)

    @property
    def scale_dn(self) -> tuple[float, float]:
        """Digital numbers of saturation above the black level, and of the black level."""
        d = self.detector
        if d is None:
            return 2.0**self.bits - 1, 0.0
        return self.saturation_e / d.gain_e_per_dn, d.black_level_dn


def with_bits(sensor: Sensor, bits: int) -> Sensor:
    """Return the sensor with images of another depth and the same full scale.

    Returns
    -------
    Sensor
        Copy; if the depth differs, a detector's gain changes accordingly and its black level is scaled and rounded.
    """
    d, ratio = sensor.detector, (2**bits - 1) / (2**sensor.bits - 1)
    if d is not None and bits != sensor.bits:
        black = float(round(d.black_level_dn * ratio))
        d = replace(d, gain_e_per_dn=d.gain_e_per_dn / ratio, black_level_dn=black)
    return replace(sensor, bits=bits, detector=d)


def noiseless(sensor: Sensor) -> Sensor:
    """Return the sensor without noise, for clean twins.

    Returns
    -------
    Sensor
        Copy without speckle, additive noise, shot noise and dark current, and with a uniform detector free of defects;
        its response, blur and quantisation are unchanged.
    """
    detector = sensor.detector
    if detector is not None:
        detector = replace(
            detector,
            read_noise_e=0.0,
            row_noise_e=0.0,
            column_noise_e=0.0,
            dark_current_e_s=0.0,
            dsnu_e=0.0,
            dark_nonuniformity=0.0,
            prnu=0.0,
            hot_pixel_share=0.0,
            dead_pixel_share=0.0,
            cosmic_rays_cm2_s=0.0,
            shot_noise=False,
        )
    return replace(sensor, speckle_variance=0.0, gaussian_variance=0.0, detector=detector)
