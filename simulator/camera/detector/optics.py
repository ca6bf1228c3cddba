"""Parameters of the optics except distortion: aperture, transmission, vignetting, blur, glare."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from flyaround.simulator.runtime.sections import bounded

if TYPE_CHECKING:
    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.camera.lens.camera_model import Camera

PsfKind = Literal["none", "gaussian", "airy", "kernel"]


@dataclass(frozen=True, kw_only=True)
class Optics:
    """Parameters of the lens; the defaults are a perfect lens, blurred only by the sensor recipe.

    Parameters
    ----------
    f_number : float, optional
        Focal length over the diameter of the aperture.
    transmission : float, optional
        Share of the light that the glass lets through.
    transmission_curve : tuple of tuple of float, optional
        (wavelength [m], share) of a filter in ascending order, linear between and zero beyond; empty for none. It
        multiplies ``transmission``.
    wavelength_m : float, optional
        Wavelength for diffraction, the centre of the band; it does not affect the amount of light.
    psf : PsfKind, optional
        ``none``; ``gaussian`` with ``psf_sigma_px``; ``airy``, diffraction at the f-number with aberrations of
        ``psf_sigma_px``; ``kernel``, measured. The sensor recipe's blur is added.
    psf_sigma_px : float, optional
        Standard deviation of the Gaussian part [px].
    kernel : tuple of tuple of float, optional
        Measured PSF, odd numbers of rows and columns, one value per pixel; its sum is one.
    defocus : bool, optional
        True to blur the image by the disc of defocus at the target's distance.
    focus_distance_m : float, optional
        Focused distance, beyond the focal length [m]; 0 for infinity.
    natural_vignetting : bool, optional
        True if irradiance falls as cos^4 of the angle from the axis.
    mechanical_vignetting : float, optional
        Shift of the rear rim's shadow across the aperture, in aperture radii, at 45 degrees from the axis; 0 for none.
    rim_radius : float, optional
        Radius of the rear rim, in aperture radii.
    glow_share : float, optional
        Share of the light in a wide tail of the PSF; 0 for none.
    glow_radius_px : float, optional
        Standard deviation of half of that tail; the other half is three times as wide [px].
    scatter_share : float, optional
        Share of the light that glass and dust scatter into wings of the PSF, which fall with the power 2.5 of the
        distance. 0 for none; about 0.01 in a good lens, 0.03 in a dusty one. `shading.scatter` names the sources.
    veiling_glare_sr : float, optional
        Scattered sunlight, radiance over irradiance at one degree from the Sun [sr-1]; it falls with the square of the
        angle. 0 for none.
    glare_limit_deg : float, optional
        Angle of the Sun from the boresight beyond which the baffle blocks it.
    """

    f_number: float = bounded(4.0, 0.5, 64.0)
    transmission: float = bounded(1.0, 1e-6, 1.0)
    transmission_curve: tuple[tuple[float, float], ...] = ()
    wavelength_m: float = bounded(550e-9, 200e-9, 2000 * 1e-9)  # as converted from a file's nanometres
    psf: PsfKind = "none"
    psf_sigma_px: float = bounded(0.0, 0.0, 10.0)
    kernel: tuple[tuple[float, ...], ...] = ()
    defocus: bool = False
    focus_distance_m: float = bounded(0.0, 0.0, 1e6)
    natural_vignetting: bool = False
    mechanical_vignetting: float = bounded(0.0, 0.0, 10.0)
    rim_radius: float = bounded(1.2, 0.1, 10.0)
    glow_share: float = bounded(0.0, 0.0, 0.5)
    glow_radius_px: float = bounded(20.0, 2.0, 500.0)
    scatter_share: float = bounded(0.0, 0.0, 0.5)
    veiling_glare_sr: float = bounded(0.0, 0.0, 1.0)
    glare_limit_deg: float = bounded(60.0, 0.0, 180.0)

    def focal_length_m(self, camera: Camera, sensor: Sensor) -> float:
        """Return the focal length from the intrinsics and the pixel pitch.

        Returns
        -------
        float
            Focal length [m], from the horizontal ``fx_px`` and pitch.
        """
        return camera.fx_px * sensor.pixel_pitch_x_m

    def defocus_diameter_px(self, camera: Camera, sensor: Sensor, distance_m: float) -> float:
        """Return the diameter of the blur disc of a point at a distance.

        A thin lens of focal length f and aperture D = f / N, focused at s > f, images a point at d as a disc of
        diameter

            D f |d - s| / (d (s - f)), or D f / d for s at infinity.

        Returns
        -------
        float
            Diameter in horizontal pixels [px]; 0 without ``defocus``.
        """
        if not self.defocus:
            return 0.0
        f = self.focal_length_m(camera, sensor)
        aperture = f / self.f_number
        if self.focus_distance_m <= 0:
            disc = aperture * f / distance_m
        else:
            s = self.focus_distance_m
            disc = aperture * f * abs(distance_m - s) / (distance_m * (s - f))
        return float(disc / sensor.pixel_pitch_x_m)
