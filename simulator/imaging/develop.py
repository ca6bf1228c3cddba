"""From a scene's radiance to its image: what the camera package needs, taken from the scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.camera.detector.electrons import white_balance
from simulator.camera.detector.image_noise import begin_noise
from simulator.imaging.image_formation import Surroundings, digitise, expose
from simulator.scene.illumination.bands import bands_of, sun_irradiance_w_m2, sunlight_balance

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from simulator.camera.detector.image_noise import RecipeNoise
    from simulator.camera.detector.sensor import Sensor
    from simulator.runtime.arrays import Float32Array, FloatArray
    from simulator.scene.state import SceneState


def expose_scene(scene: SceneState, radiance_w_m2_sr: Float32Array) -> Float32Array:
    """Noise-free signal of a drawn scene, 1 at full scale: lens, exposure, PSF.

    Parameters
    ----------
    radiance_w_m2_sr : (H, W) or (H, W, 3) [W m-2 sr-1], row 0 at the top.
    """
    around = Surroundings(
        camera=scene.camera,
        target_distance_m=float(np.linalg.norm(scene.t_camera_from_target_m)),
        sun_direction=np.array(scene.sun_direction_camera),
        sun_irradiance_w_m2=_sun_at_the_lens(scene, radiance_w_m2_sr),
    )
    return expose(
        radiance_w_m2_sr, scene.sensor, scene.exposure_s, sunlight_balance(scene.bands), scene.optics, around
    )


def begin_scene_noise(scene: SceneState) -> Callable[[], RecipeNoise]:
    """Have the additive noise of a scene's picture drawn by another thread, for `digitise_scene`."""
    bands = len(bands_of(scene.bands))
    size = (scene.camera.height_px, scene.camera.width_px)
    return begin_noise(size if bands == 1 else (*size, bands), scene.sensor, scene.seed, scene.frame_index)


def digitise_scene(
    scene: SceneState,
    signal: Float32Array,
    sensor: Sensor | None = None,
    noise: Callable[[], RecipeNoise] | None = None,
) -> NDArray[np.unsignedinteger]:
    """Digital numbers of an exposed scene.

    Parameters
    ----------
    signal : what `expose_scene` gives. sensor : instead of the scene's, for example its noiseless twin.
    noise : what `begin_scene_noise` gave, of the scene's own sensor.
    """
    sensor = sensor or scene.sensor
    balance = sunlight_balance(scene.bands)
    return digitise(
        signal,
        sensor,
        scene.seed,
        scene.frame_index,
        scene.exposure_s,
        balance if sensor.detector is None else white_balance(sensor, scene.optics, balance),
        noise,
    )


def _sun_at_the_lens(scene: SceneState, radiance: Float32Array) -> FloatArray:
    """Irradiance of the Sun at the camera per band, less what hides it [W m-2].

    In the shadow of the Earth it is the target's share; where the disc is in the image, what the picture shows of it.
    """
    to_sun = np.asarray(scene.r_sun_eci_m) - np.asarray(scene.r_camera_eci_m)
    irradiance = sun_irradiance_w_m2(scene.bands, float(np.linalg.norm(to_sun))) * scene.sun_visible_fraction
    if scene.optics.veiling_glare_sr <= 0:
        return irradiance
    direction = np.array(scene.sun_direction_camera)
    pixel = scene.camera.project(direction)
    if scene.environment.sun and direction[2] > 0 and scene.camera.contains(pixel):
        x, y = (int(v) for v in np.rint(pixel))
        near = radiance[max(y - 2, 0) : y + 3, max(x - 2, 0) : x + 3]
        solid_angle = np.pi * (6.957e8 / np.linalg.norm(to_sun)) ** 2
        covered = scene.camera.pixel_solid_angle_sr(pixel)
        brightest = near.reshape(-1, *near.shape[2:]).max(axis=0)
        full = irradiance / np.maximum(solid_angle, covered)
        irradiance = irradiance * np.clip(np.max(brightest / np.maximum(full, 1e-9)) * 1.5, 0, 1)
    return irradiance
