"""A lamp on the chaser: its beam and the irradiance on a surface, per band. CPU twin of shaders/craft/lamp.glsl."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from msgspec import Meta

from flyaround.simulator.runtime.arrays import FloatArray
from flyaround.simulator.runtime.sections import MetresXyz, Section
from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.world.constants import AU_M

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.scene.illumination.bands import Bands

Profile = Literal["led", "gaussian", "flat"]
FLAT_EDGE = 0.03  # share of the half angle over which a flat beam falls to zero


class Lamp(Section, frozen=True, kw_only=True):
    """A lamp on the chaser, aligned with the camera's boresight.

    ``power_w`` is that of the whole beam in the panchromatic band; the intensity is half at ``half_angle_deg`` (a
    ``flat`` beam ends there). ``offset_m`` is its position right of, below and in front of the camera; it casts no
    shadows.
    """

    # with the Sun's spectrum
    power_w: Annotated[float, Meta(gt=0, le=1e6)]
    half_angle_deg: Annotated[float, Meta(ge=0.5, le=80)] = 20.0
    # led: power of the cosine, as for bare or lensed diodes; gaussian in the angle; flat inside its cone
    profile: Profile = "led"
    # far from the camera its shadows would be visible, by the ratio of this to the range
    offset_m: MetresXyz = (0.0, 0.0, 0.0)

    @property
    def shape(self) -> float:
        """The exponent of ``led``; for other profiles the inverse half angle [rad-1]."""
        half = np.radians(self.half_angle_deg)
        return float(np.log(0.5) / np.log(np.cos(half)) if self.profile == "led" else 1 / half)

    def beam(self, angle_rad: ArrayLike) -> FloatArray:
        """Return the intensity relative to that on the axis.

        Returns
        -------
        array
            Relative intensity 0 to 1, of the shape of ``angle_rad``; 0 beyond 90 degrees.
        """
        angle = np.asarray(angle_rad, float)
        cosine = np.clip(np.cos(angle), 0, None)
        if self.profile == "led":
            return np.asarray(cosine**self.shape)
        share = angle * self.shape
        if self.profile == "gaussian":
            return np.asarray(np.exp2(-share * share) * (cosine > 0))
        return np.asarray(np.clip((1 - share) / FLAT_EDGE + 0.5, 0, 1) * (cosine > 0))

    def intensity_w_sr(self, bands: Bands) -> FloatArray:
        """Return the radiant intensity on the axis, per band.

        Returns
        -------
        (n,) array
            Intensity [W sr-1], in the order of the image's channels.
        """
        cosine = (np.arange(20_000) + 0.5) / 20_000
        solid_angle = 2 * np.pi * float(np.mean(self.beam(np.arccos(cosine))))
        colour = sun_irradiance_w_m2(bands, AU_M) / sun_irradiance_w_m2("mono", AU_M)
        return np.asarray(self.power_w / solid_angle * colour)

    def irradiance_w_m2(self, positions_m: FloatArray, normals: FloatArray, bands: Bands) -> FloatArray:
        """Return the (K, n) irradiance on surfaces.

        Parameters
        ----------
        positions_m : (K, 3) array
            Illuminated points, camera frame [m].
        normals : (K, 3) array
            Unit normals there, camera frame.
        bands : Bands
            Spectral bands of the image.

        Returns
        -------
        (K, n) array
            Irradiance per band [W m-2].
        """
        to_lamp = np.asarray(self.offset_m) - positions_m
        distance = np.linalg.norm(to_lamp, axis=1)
        light = to_lamp / distance[:, None]
        off_axis = np.arccos(np.clip(-light[:, 2], -1, 1))
        falling = self.beam(off_axis) / distance**2 * np.clip((light * normals).sum(axis=1), 0, None)
        return np.asarray(falling[:, None] * self.intensity_w_sr(bands))
