"""Area lights: diffuse boxes and lamps of finite size. CPU twin of shaders/craft/area_lights.glsl."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from msgspec import Meta

from flyaround.simulator.runtime.sections import Degrees, DirectionXyz, Section
from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.world.constants import AU_M

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.world.frames.pose import Pose

_Place = Annotated[float, Meta(ge=-1e4, le=1e4)]
Side = Annotated[float, Meta(ge=0.01, le=100)]

# Maximum number of lights, that of the shader.
MAX_LIGHTS = 8

DIFFUSE_DEG = 60.0
"""Half angle at which a Lambertian emitter has half of its on-axis intensity [deg]."""


class AreaLight(Section, frozen=True, kw_only=True):
    """A luminous rectangle: a diffuse box (``half_angle_deg`` of 60) or, with a narrower beam, a lamp.

    ``position_m`` is its centre in the axes of ``frame``: ``camera`` (right, down, forward) or ``target``. It emits on
    one side, along ``direction``, or by default towards the target's origin; ``turn_deg`` rotates it about that axis.
    The radiance is that on the axis, panchromatic, with the Sun's spectrum. The rectangle itself is not drawn.
    """

    position_m: tuple[_Place, _Place, _Place]
    radiance_w_m2_sr: Annotated[float, Meta(gt=0, le=1e8)]
    frame: Literal["camera", "target"] = "camera"
    direction: DirectionXyz | None = None
    width_m: Side = 1.0
    height_m: Side = 1.0
    turn_deg: Degrees = 0.0
    # the intensity falls to half at this angle from the axis
    half_angle_deg: Annotated[float, Meta(ge=1, le=60)] = DIFFUSE_DEG

    @property
    def exponent(self) -> float:
        """Exponent of the cosine from the axis in the radiance; 0 for a diffuse light."""
        return max(float(np.log(0.5) / np.log(np.cos(np.radians(self.half_angle_deg)))) - 1.0, 0.0)

    def in_camera_frame(self, camera_from_target: Pose) -> CameraFrameLight:
        """Return the light in camera axes.

        Returns
        -------
        CameraFrameLight
            Rectangle [m] and its axis. A light on the target's origin, and aimed at it, emits along +z of ``frame``.
        """
        middle, along = np.asarray(self.position_m, float), self.direction
        origin = np.zeros(3) if self.frame == "target" else np.asarray(camera_from_target.t_m)
        axis = origin - middle if along is None or not np.any(along) else np.asarray(along, float)
        length = float(np.linalg.norm(axis))
        axis = np.array([0.0, 0.0, 1.0]) if length < 1e-9 else axis / length
        across, down = light_axes(axis)
        c, s = np.cos(np.radians(self.turn_deg)), np.sin(np.radians(self.turn_deg))
        right, down = c * across + s * down, c * down - s * across
        if self.frame == "target":
            R = camera_from_target.R
            middle, axis, right, down = camera_from_target.apply(middle), R @ axis, R @ right, R @ down
        return CameraFrameLight(
            middle, axis, right * (self.width_m / 2), down * (self.height_m / 2), self.exponent
        )

    def radiance(self, bands: Bands) -> FloatArray:
        """Return the radiance on the axis, per band.

        Returns
        -------
        (n,) array
            Radiance [W m-2 sr-1], in the order of the image's channels.
        """
        colour = sun_irradiance_w_m2(bands, AU_M)
        return np.asarray(self.radiance_w_m2_sr * colour / sun_irradiance_w_m2("mono", AU_M))


def light_axes(axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors perpendicular to an axis.

    Returns
    -------
    transverse : (3,) array
        Unit vector perpendicular to y, which in camera axes is level; +x if the axis is along y.
    down : (3,) array
        Cross product of the axis and ``transverse``, of unit length; downward in camera axes.
    """
    transverse = np.cross([0.0, 1.0, 0.0], axis)
    length = float(np.linalg.norm(transverse))
    # an axis along y has no level; any transverse serves
    transverse = np.array([1.0, 0.0, 0.0]) if length < 1e-3 else transverse / length
    down = np.cross(axis, transverse)
    return transverse, down / np.linalg.norm(down)


@dataclass(frozen=True, eq=False)
class CameraFrameLight:
    """A light in camera axes.

    Parameters
    ----------
    middle_m : (3,) array
        Centre.
    axis : (3,) array
        Unit vector of emission.
    right_m : (3,) array
        Half of the horizontal side [m].
    down_m : (3,) array
        Half of the vertical side [m].
    exponent : float
        Exponent of the cosine from the axis.
    """

    middle_m: FloatArray
    axis: FloatArray
    right_m: FloatArray
    down_m: FloatArray
    exponent: float

    def points_m(self, count: int) -> FloatArray:
        """Return points that represent equal patches of the rectangle.

        Returns
        -------
        (count, 3) array
            Positions in camera axes [m]; no two are on a line parallel to a side.
        """
        u, v = rook_points(count).T
        return np.asarray(self.middle_m + u[:, None] * self.right_m + v[:, None] * self.down_m)

    @property
    def area_m2(self) -> float:
        """Area of the rectangle [m2]."""
        return float(4 * np.linalg.norm(np.cross(self.right_m, self.down_m)))

    def irradiance_factor(self, positions_m: FloatArray, normals: FloatArray, count: int = 16) -> FloatArray:
        """Return (K,) irradiance over radiance on unshadowed faces [sr].

        Parameters
        ----------
        positions_m : (K, 3) array
            Illuminated points, camera frame [m].
        normals : (K, 3) array
            Unit normals there, camera frame.
        count : int, optional
            Number of patches.

        Returns
        -------
        (K,) array
            Factors [sr].
        """
        d = self.points_m(count)[None] - np.asarray(positions_m, float)[:, None]
        square = np.maximum((d * d).sum(axis=2), 1e-4)
        towards = d / np.sqrt(square)[..., None]
        incidence = np.clip((towards * np.asarray(normals)[:, None]).sum(axis=2), 0, None)
        leaving = np.clip(-(towards @ self.axis), 0, None)
        beam = leaving * leaving**self.exponent
        return np.asarray((incidence * beam / square).mean(axis=1) * self.area_m2)


@lru_cache(maxsize=16)
def rook_points(count: int) -> FloatArray:
    """Return (count, 2) points of the square from -1 to 1, one in each row and column (N-rooks).

    Columns are in the order of multiples of the golden ratio, so that neighbouring rows are far apart.
    """
    k = np.arange(count)
    order = np.argsort(np.argsort((k * 0.6180339887498949) % 1.0))
    return np.asarray(np.stack([2 * k + 1 - count, 2 * order + 1 - count], axis=1) / count)
