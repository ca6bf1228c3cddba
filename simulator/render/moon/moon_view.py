"""View of the Moon: the camera in lunar axes and radii, the Moon's illumination, and the pixels that show the Moon."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.frame_graph import Pass, Resource
from flyaround.simulator.render.gl.uniform_block import vec4_of_bands
from flyaround.simulator.render.projection import PixelRect
from flyaround.simulator.render.view import SCENE
from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.scene.illumination.moonlight import moon_albedo
from flyaround.simulator.scene.illumination.refraction import shadow_profile
from flyaround.simulator.world.constants import EARTH_MEAN_RADIUS_M, MOON_RADIUS_M
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.gl.uniform_block import UniformBlock
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.state import SceneState

EARTH_GEOMETRIC_ALBEDO = 0.367  # Allen's Astrophysical Quantities (2000), table 12.4

# Margin of the camera's half angle [rad], because it is that of sampled pixels, and angle beyond which the whole image
# is taken [rad]: near 90 degrees projections diverge.
_HALF_ANGLE_MARGIN_RAD, _MAX_ANGLE_RAD = 0.01, 1.5
# Points of the projected rim, and factor on its angle: chords of 64 points lie inside the circle by 0.1 %.
_RIM_POINTS, _RIM_FACTOR = 64, 1.02

# Distance from the axis of the Earth's shadow within which the penumbra may touch the Moon [m]. At apogee the penumbra
# reaches 8300 km from the axis, R_E + d (R_S + R_E) / D, and the Moon 1737 km further; the rest is margin for the air.
_SHADOW_REACH_M = 1.4e7


@dataclass(frozen=True, eq=False)
class MoonView:
    """The camera and the Moon's illumination, in the Moon's body-fixed axes and in lunar radii, float64.

    Parameters
    ----------
    moon_from_camera : (3, 3) array
        Rotation from the camera frame to the Moon's axes.
    camera : (3,) array
        Position of the camera.
    sun : (3,) array
        Unit vector from the Moon to the Sun.
    earth : (3,) array
        Unit vector from the Moon to the Earth.
    earthlight : float
        Irradiance of the Earth on the Moon over that of the Sun.
    irradiance_w_m2 : (n,) array
        Irradiance of the Sun on the Moon, per band [W m-2].
    albedo : (n,) array
        Geometric albedo, per band.
    shadow : (3,) array
        Vector from the Earth to the Moon.
    shadow_axis : (3,) array
        Unit vector along the Earth's shadow.
    shadow_share : (K, n) array or None
        Fraction of the Sun's light at K distances from the axis of the Earth's shadow, per band; ``None`` if the Moon
        is clear of the shadow.
    shadow_reach : float
        Largest of these distances.
    center_camera : (3,) array
        Unit vector to the Moon's centre, camera frame.
    sine : float
        Sine of the Moon's angular radius.
    in_front : bool
        True if the Moon is nearer than the globe.
    rect : PixelRect or None
        Pixels that the Moon may touch; ``None`` if there are none.
    """

    moon_from_camera: FloatArray
    camera: FloatArray
    sun: FloatArray
    earth: FloatArray
    earthlight: float
    irradiance_w_m2: FloatArray
    albedo: FloatArray
    shadow: FloatArray
    shadow_axis: FloatArray
    shadow_share: FloatArray | None
    shadow_reach: float
    center_camera: FloatArray
    sine: float
    in_front: bool
    rect: PixelRect | None

    def hides(self, directions_camera: FloatArray) -> np.typing.NDArray[np.bool_]:
        """Return a mask of the unit directions (K, 3), camera frame, that hit the Moon's disc."""
        return np.asarray(directions_camera @ self.center_camera > np.sqrt(max(1 - self.sine**2, 0.0)))


MOON: Resource[MoonView] = Resource("moon")


class MoonViewPass(Pass):
    """Finds the Moon in the image and writes its uniforms."""

    name = "moon.view"
    reads = (SCENE,)
    writes = (MOON,)

    def __init__(self, block: UniformBlock) -> None:
        self._block = block

    def run(self, r: PassResources) -> None:
        """Find the Moon, if the scene has one."""
        if r[SCENE].environment.moon:
            r[MOON] = moon = moon_view(r[SCENE])
            self._block.write(moon_values(moon))


def moon_view(scene: SceneState) -> MoonView:
    """Find the Moon in the image and compute its light."""
    R_ce = matrix_from_quat(scene.q_camera_from_eci_wxyz)
    state = scene.body("moon")
    R_me, moon, sun = state.R_fixed_from_eci, np.asarray(state.r_eci_m), np.asarray(scene.r_sun_eci_m)
    moon_to_camera = np.asarray(scene.r_camera_eci_m) - moon
    distance = float(np.linalg.norm(moon_to_camera))
    moon_to_sun = sun - moon
    sun_distance = float(np.linalg.norm(moon_to_sun))
    earth_distance = float(np.linalg.norm(moon))
    axis = -sun / np.linalg.norm(sun)
    distance_behind_earth = float(moon @ axis)
    distance_from_axis = float(np.linalg.norm(moon - distance_behind_earth * axis))
    share, reach = None, 1.0
    if distance_behind_earth > 0 and distance_from_axis < _SHADOW_REACH_M:
        share, reach = shadow_profile(
            round(distance_behind_earth / 1e3), round(sun_distance / 1e9), scene.bands
        )
    # cosine of the angle Earth - Moon - Sun
    cosine = float(-moon @ moon_to_sun / (earth_distance * sun_distance))
    # phase of the Earth seen from the Moon, as a Lambert sphere
    phase = np.pi - np.arccos(np.clip(cosine, -1, 1))
    lambert = (np.sin(phase) + (np.pi - phase) * np.cos(phase)) / np.pi
    center = R_ce @ (-moon_to_camera / distance)
    sine = min(MOON_RADIUS_M / distance, 1.0)
    return MoonView(
        moon_from_camera=R_me @ R_ce.T,
        camera=R_me @ moon_to_camera / MOON_RADIUS_M,
        sun=R_me @ moon_to_sun / sun_distance,
        earth=R_me @ -moon / earth_distance,
        earthlight=EARTH_GEOMETRIC_ALBEDO * (EARTH_MEAN_RADIUS_M / earth_distance) ** 2 * float(lambert),
        irradiance_w_m2=sun_irradiance_w_m2(scene.bands, sun_distance),
        albedo=moon_albedo(scene.bands),
        shadow=R_me @ moon / MOON_RADIUS_M,
        shadow_axis=R_me @ axis,
        shadow_share=share,
        shadow_reach=reach / MOON_RADIUS_M,
        center_camera=center,
        sine=sine,
        in_front=distance < float(np.linalg.norm(np.subtract(scene.r_camera_eci_m, scene.globe.r_eci_m))),
        rect=disc_rect(scene.camera, center, sine),
    )


def disc_rect(camera: Camera, center_camera: FloatArray, sine: float) -> PixelRect | None:
    """Return the pixels that a sphere may touch, or None if it is not in the image.

    Parameters
    ----------
    camera : Camera
        Camera of the scene.
    center_camera : (3,) array
        Unit vector to the sphere's centre, camera frame.
    sine : float
        Sine of its angular radius.
    """
    whole_image = PixelRect(0, 0, camera.width_px, camera.height_px)
    radius, angle_from_boresight = np.arcsin(min(sine, 1.0)), np.arccos(np.clip(center_camera[2], -1, 1))
    if angle_from_boresight > radius + camera.half_angle_rad() + _HALF_ANGLE_MARGIN_RAD:
        return None
    # a circle slightly outside the rim, of some size if the sphere is a point
    rim_angle = _RIM_FACTOR * radius + 1e-5
    if angle_from_boresight + rim_angle > _MAX_ANGLE_RAD:
        return whole_image
    side = np.cross(center_camera, [0.0, 0.0, 1.0] if abs(center_camera[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    up = np.cross(center_camera, side)
    angle = np.arange(_RIM_POINTS) / _RIM_POINTS * 2 * np.pi
    rim = center_camera + np.tan(rim_angle) * (np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * up)
    pixels: ArrayLike = camera.project(rim)
    low, high = np.floor(np.min(pixels, axis=0)) - 1, np.ceil(np.max(pixels, axis=0)) + 2
    x0, y0 = (max(int(v), 0) for v in low)
    x1, y1 = min(int(high[0]), camera.width_px), min(int(high[1]), camera.height_px)
    return PixelRect(x0, y0, x1, y1) if x1 > x0 and y1 > y0 else None


def moon_values(moon: MoonView) -> dict[str, ArrayLike]:
    """Return the members of the uniform block ``Moon``."""
    matrix = np.eye(4)
    matrix[:3, :3] = moon.moon_from_camera
    longitude = float(np.arctan2(moon.camera[1], moon.camera[0]))
    return {
        "u_moon_from_camera": matrix,
        "u_moon_camera": [*moon.camera, 0.0],
        "u_moon_sun": [*moon.sun, 0.0],
        "u_moon_earth": [*moon.earth, moon.earthlight],
        "u_moon_meridian": [np.cos(longitude), np.sin(longitude), longitude, 0.0],
        "u_moon_albedo": vec4_of_bands(moon.albedo),
        "u_moon_irradiance": vec4_of_bands(moon.irradiance_w_m2),
        "u_moon_shadow": [*moon.shadow, moon.shadow_reach],
        "u_moon_shadow_axis": [*moon.shadow_axis, 0.0],
    }
