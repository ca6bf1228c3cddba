"""The scene in camera coordinates, which all render passes use.

Positions are subtracted and rotated in float64 before anything is converted to float32 for the GPU.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.frame_graph import Pass, Resource
from flyaround.simulator.render.gl.uniform_block import vec4_of_bands
from flyaround.simulator.scene.illumination.bands import bands_of, sun_irradiance_w_m2
from flyaround.simulator.scene.illumination.irradiance import IrradianceField, dark_field
from flyaround.simulator.scene.illumination.moonlight import moonlight_share
from flyaround.simulator.scene.illumination.refraction import sunlight_past_earth
from flyaround.simulator.world.constants import (
    MOON_RADIUS_M,
    SUN_RADIUS_M,
)
from flyaround.simulator.world.ephemeris.eclipse import sun_fraction_past_sphere
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike

    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.gl.uniform_block import UniformBlock
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.ephemeris.body import Body


@dataclass(frozen=True, eq=False)
class View:
    """Geometry and illumination of one scene in the camera frame, float64.

    Parameters
    ----------
    R_camera_from_target : (3, 3) array
        Rotation from the target to the camera frame.
    t_camera_from_target_m : (3,) array
        Origin of the target, camera frame [m].
    globe : Body
        Body that is drawn by ray casting.
    R_camera_from_globe : (3, 3) array
        Rotation from the globe's body-fixed axes to the camera frame.
    R_camera_from_eci : (3, 3) array
        Rotation from the inertial frame (GCRS) to the camera frame.
    r_camera_globe_m : (3,) array
        Camera position relative to the globe's centre, body-fixed axes of the globe [m].
    sun_direction : (3,) array
        Unit vector from the target to the Sun, camera frame.
    sun_sine : float
        Sine of the Sun's angular radius.
    sun_globe : (3,) array
        Unit vector from the globe to the Sun, body-fixed axes of the globe.
    moon_globe : (3,) array
        Unit vector from the globe to the Moon, body-fixed axes of the globe.
    moon_share : float
        Irradiance of the Moon at the globe relative to the Sun's; 0 if no Moon is drawn.
    sun_irradiance_w_m2 : (n,) array
        Irradiance of the unobstructed Sun at the target, per band [W m-2].
    sun_at_globe_w_m2 : (n,) array
        Irradiance of the Sun at the globe, per band [W m-2].
    sun_visible_fraction : float
        Visible fraction of the Sun's disc at the target.
    sun_share : (n,) array
        Fraction of the Sun's irradiance that Earth, air and Moon transmit to the target, per band.
    sky : IrradianceField
        Irradiance of globe and Moon on the target.
    lights : tuple of tuple of array, optional
        For each area light, the unit vector from the target's origin (3,) and the irradiance there per band (n,)
        [W m-2].
    """

    R_camera_from_target: FloatArray
    t_camera_from_target_m: FloatArray
    globe: Body
    R_camera_from_globe: FloatArray
    R_camera_from_eci: FloatArray
    r_camera_globe_m: FloatArray
    sun_direction: FloatArray
    sun_sine: float
    sun_globe: FloatArray
    moon_globe: FloatArray
    moon_share: float
    sun_irradiance_w_m2: FloatArray
    sun_at_globe_w_m2: FloatArray
    sun_visible_fraction: float
    sun_share: FloatArray
    sky: IrradianceField
    lights: tuple[tuple[FloatArray, FloatArray], ...] = ()


SCENE: Resource[SceneState] = Resource("scene")
MODEL: Resource[Target] = Resource("target model")
VIEW: Resource[View] = Resource("view")
"""The scene in camera coordinates. `ShinePass` adds the light of Earth and Moon on the target."""
GIVEN_IRRADIANCE: Resource[IrradianceField] = Resource("given irradiance")
"""Replacement for the light of Earth and Moon on the target, for validation."""


class SetUpPass(Pass):
    """Pass that builds the view and writes its uniforms, without the light of Earth and Moon on the target."""

    name = "setup"
    reads = (SCENE,)
    optional = (GIVEN_IRRADIANCE,)
    writes = (VIEW,)

    def __init__(self, block: UniformBlock) -> None:
        self._block = block

    def run(self, r: PassResources) -> None:
        """Build the view."""
        r[VIEW] = view = build_view(r[SCENE], r.find(GIVEN_IRRADIANCE))
        self._block.write(frame_values(r[SCENE], view))


def build_view(scene: SceneState, sky: IrradianceField | None = None) -> View:
    """Convert a scene to the camera frame.

    Parameters
    ----------
    scene : SceneState
        Scene to render.
    sky : IrradianceField, optional
        Irradiance of globe and Moon on the target (`globe_and_moon_shine`), or a replacement; ``None`` for none.
    """
    R_ce = matrix_from_quat(scene.q_camera_from_eci_wxyz)
    globe = scene.globe
    R_ge, centre = globe.R_fixed_from_eci, np.asarray(globe.r_eci_m)
    r_camera, r_target = np.asarray(scene.r_camera_eci_m), np.asarray(scene.r_target_eci_m)
    r_sun = np.asarray(scene.r_sun_eci_m)
    to_sun = r_sun - r_target
    sun_distance = float(np.linalg.norm(to_sun))
    sun_m = float(np.linalg.norm(r_sun - centre))
    sun_unit = (r_sun - centre) / sun_m
    sun_w_m2 = sun_irradiance_w_m2(scene.bands, sun_distance)
    r_moon = np.asarray(scene.body("moon").r_eci_m) - centre
    return View(
        R_camera_from_target=matrix_from_quat(scene.q_camera_from_target_wxyz),
        t_camera_from_target_m=np.asarray(scene.t_camera_from_target_m),
        globe=globe.body,
        R_camera_from_globe=R_ce @ R_ge.T,
        R_camera_from_eci=R_ce,
        r_camera_globe_m=R_ge @ (r_camera - centre),
        sun_direction=R_ce @ (to_sun / sun_distance),
        sun_sine=SUN_RADIUS_M / sun_distance,
        sun_globe=R_ge @ sun_unit,
        moon_globe=R_ge @ (r_moon / np.linalg.norm(r_moon)),
        moon_share=moonlight_share(r_moon, sun_unit) if scene.environment.moon else 0.0,
        sun_irradiance_w_m2=sun_w_m2,
        sun_at_globe_w_m2=sun_irradiance_w_m2(scene.bands, sun_m),
        sun_visible_fraction=scene.sunlit_fraction,
        sun_share=_sun_share(scene),
        sky=dark_field(len(bands_of(scene.bands))) if sky is None else sky,
        lights=tuple(_distant_lights(scene)),
    )


def _distant_lights(scene: SceneState) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield direction (3,) and irradiance (n,) of each area light at the target's origin.

    The light that the target's parts reflect on each other is computed as if these lights were far away.
    """
    origin = np.asarray(scene.t_camera_from_target_m)
    for light in scene.area_lights:
        at_target = light.in_camera_frame(scene.camera_from_target)
        offset = at_target.middle_m - origin
        # a light at the origin has no direction
        direction = offset / max(float(np.linalg.norm(offset)), 1e-6)
        factor = float(at_target.irradiance_factor(origin[None], direction[None])[0])
        yield direction, factor * light.radiance(scene.bands)


def _sun_share(scene: SceneState) -> FloatArray:
    """Return the fraction (n,) of the Sun's light that reaches the target per band, through the air if it is drawn."""
    fraction = np.full(len(bands_of(scene.bands)), scene.sunlit_fraction)
    if not scene.environment.sunlight or not (scene.environment.earth and scene.environment.atmosphere):
        return fraction
    earth = scene.body("earth")
    # map the ellipsoid to a sphere
    to_sphere = np.array([1.0, 1.0, earth.body.radius_m / earth.body.polar_radius_m])
    R_itrs_from_eci = earth.R_fixed_from_eci
    r, sun = np.asarray(scene.r_target_eci_m), np.asarray(scene.r_sun_eci_m)
    transmittance = sunlight_past_earth(
        to_sphere * (R_itrs_from_eci @ r), to_sphere * (R_itrs_from_eci @ sun), scene.bands
    )
    if np.all(transmittance == 1):
        return fraction
    moon = np.asarray(scene.body("moon").r_eci_m)
    return transmittance * float(sun_fraction_past_sphere(r - moon, sun - moon, MOON_RADIUS_M))


def frame_values(scene: SceneState, view: View) -> dict[str, ArrayLike]:
    """Return the members of the uniform block ``Frame``."""
    camera, sky = scene.camera, view.sky
    u_sky, u_globe = np.zeros((10, 4)), np.zeros((3, 4))
    u_sky[:, : sky.irradiance_w_m2.shape[1]] = sky.irradiance_w_m2
    u_globe[: len(sky.radiance_w_m2_sr)] = sky.radiance_w_m2_sr
    lamp = scene.lamp
    return {
        "u_intrinsics": [camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px],
        "u_sun_direction": [*view.sun_direction, view.sun_sine],
        "u_sun_irradiance": vec4_of_bands(view.sun_irradiance_w_m2 * view.sun_share),
        "u_sky": u_sky,
        "u_globe_radiance": u_globe,
        "u_globe_rim": [*sky.axis, sky.disc_cosine],
        # mean direction of the light: between normal and nadir for a hemisphere, the normal for a full sphere
        "u_nadir_direction": [*sky.axis, float(np.clip((1 + sky.disc_cosine) / 2, 0, 1))],
        "u_lamp_place": [0.0] * 4 if lamp is None else [*lamp.offset_m, lamp.shape],
        "u_lamp_intensity": [0.0] * 4 if lamp is None else vec4_of_bands(lamp.intensity_w_sr(scene.bands)),
    }
