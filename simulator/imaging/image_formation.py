"""Image formation from radiance to digital numbers: lens, exposure, PSF, noise and quantisation.

The noise of frame k depends on (seed, k) only, not on earlier frames or the number of threads.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.camera.detector.image_noise import choose_arithmetic, draw_noise, start_noise
from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.psf import blur, defocus_px
from flyaround.simulator.camera.detector.readout import detect, detector_sigma
from flyaround.simulator.camera.detector.response import electrons_per_radiance, white_balance
from flyaround.simulator.camera.detector.shading import glow, scatter, veiling_glare, vignetting
from flyaround.simulator.camera.detector.transfer import converter, encode_numbers
from flyaround.simulator.runtime.threads import run_in_threads, split_rows, threads
from flyaround.simulator.scene.illumination.bands import bands_of, sun_irradiance_w_m2, sunlight_balance
from flyaround.simulator.world.constants import SUN_RADIUS_M

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from flyaround.simulator.camera.detector.image_noise import ImageNoise
    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray
    from flyaround.simulator.scene.state import SceneState

_PERFECT_LENS = Optics()
_PIECE_VALUES = 3 << 18  # values per task for two threads; shorter tasks would wait for Python's global lock
_SHORT_VALUES = 3 << 16  # values per task for more threads


@dataclass(frozen=True, eq=False)
class ViewingConditions:
    """Geometry and light that vignetting, glare and defocus depend on.

    Parameters
    ----------
    camera : Camera
        Geometry of the camera.
    target_distance_m : float
        Distance for defocus.
    sun_direction : array
        Unit vector, camera frame.
    sun_irradiance_w_m2 : array
        Irradiance of the visible part per band, for glare.
    """

    camera: Camera
    target_distance_m: float
    sun_direction: FloatArray
    sun_irradiance_w_m2: FloatArray


def expose(
    radiance_w_m2_sr: Float32Array,
    sensor: Sensor,
    exposure_s: float,
    band_gain: ArrayLike = 1.0,
    optics: Optics | None = None,
    conditions: ViewingConditions | None = None,
) -> Float32Array:
    """Return the noise-free signal on the detector: vignetting and glare, exposure, PSF.

    Parameters
    ----------
    radiance_w_m2_sr : (H, W) or (H, W, 3) array
        Band radiance [W m-2 sr-1].
    sensor : Sensor
        Detector; ``full_scale_j_m2_sr``, or its saturation charge, maps to 1.
    exposure_s : float
        Integration time [s].
    band_gain : array_like, optional
        For a detector in electrons only: `white_balance` of a colour image.
    optics : Optics, optional
        None for a perfect lens.
    conditions : ViewingConditions, optional
        Inputs for vignetting, glare and defocus; None to omit those.

    Returns
    -------
    (H, W) or (H, W, 3) float32 array
        1 at full scale, not clipped.
    """
    optics = optics or _PERFECT_LENS
    bands = 1 if radiance_w_m2_sr.ndim == 2 else radiance_w_m2_sr.shape[2]
    if sensor.detector is None:
        gain = np.asarray(band_gain, float) * exposure_s / sensor.full_scale_j_m2_sr
    else:
        gain = electrons_per_radiance(sensor, optics, exposure_s, bands) / sensor.saturation_e
    image, disc_px = radiance_w_m2_sr, 0.0
    if conditions is not None:
        image = _apply_lens_effects(image, optics, conditions)
        disc_px = defocus_px(conditions.camera, optics, sensor, conditions.target_distance_m)
    by_band = gain.astype(np.float32) if gain.size > 1 else float(gain.flat[0])
    return blur(image, optics, sensor, disc_px, by_band)


def _apply_lens_effects(image: Float32Array, optics: Optics, conditions: ViewingConditions) -> Float32Array:
    """Apply vignetting, veiling glare, glow and scatter; return the image itself if there are none."""
    transmission = vignetting(conditions.camera, optics)
    if transmission is not None:
        image = image * (transmission if image.ndim == 2 else transmission[..., None])
    glare = veiling_glare(conditions.camera, optics, conditions.sun_direction, conditions.sun_irradiance_w_m2)
    return scatter(glow(image if glare is None else image + glare, optics), optics)


def noise_sigma(sensor: Sensor, signal: float = 0.0, exposure_s: float = 0.0) -> float:
    """Return the standard deviation of the noise on a 0..1 signal, quantisation included.

    Returns
    -------
    float
        Standard deviation relative to full scale; with a detector, relative to saturation.
    """
    if sensor.detector is not None:
        return detector_sigma(sensor, signal, exposure_s)
    step = 1.0 / (2**sensor.bits - 1)
    return float(np.sqrt(sensor.gaussian_variance + sensor.speckle_variance * signal**2 + step**2 / 12))


def digitise(
    signal: Float32Array,
    sensor: Sensor,
    seed: int,
    frame_index: int,
    exposure_s: float = 0.0,
    band_gain: ArrayLike = 1.0,
    noise: Callable[[], ImageNoise] | None = None,
) -> NDArray[np.unsignedinteger]:
    """Return digital numbers of an exposed signal: by the detector, or clip, speckle, Gaussian noise, clip, quantise.

    The Milan thesis, the source of the recipe with speckle, does not state an order. Here uniform speckle ``I + n I``
    comes first, then the Gaussian term, then the clip, as in consecutive calls of MATLAB's ``imnoise``.

    Parameters
    ----------
    signal : (H, W) or (H, W, 3) float32 array
        1 = full scale.
    sensor : Sensor
        Noise recipe and bit depth.
    seed : int
        Seed of the random numbers.
    frame_index : int
        Number of the frame; with ``seed`` the key of its random numbers.
    exposure_s : float, optional
        For a detector in electrons only: exposure time, for dark current, and `white_balance` of a colour image.
    band_gain : array_like, optional
        For a detector in electrons only: exposure time, for dark current, and `white_balance` of a colour image.
    noise : callable, optional
        Result of `start_noise` for this sensor, seed, frame and shape; by default, drawn here.

    Returns
    -------
    array
        Array of the signal's shape, uint8 for up to 8 bits, uint16 above.
    """
    if sensor.detector is not None:
        return detect(signal, sensor, seed, frame_index, exposure_s, band_gain)
    arithmetic = choose_arithmetic(sensor)
    full, steps_per_dn = arithmetic.full_dn, arithmetic.steps_per_dn
    random = noise() if noise is not None else draw_noise(signal.shape, sensor, seed, frame_index)
    flat = signal.reshape(signal.shape[0], -1)
    out = np.empty(flat.shape, np.uint8 if sensor.bits <= 8 else np.uint16)

    def digitise_rows(first: int, end: int) -> None:
        rows = slice(first, end)
        values = np.clip(flat[rows], 0.0, 1.0)
        values *= np.float32(full * steps_per_dn)
        if random.factors is not None:
            values *= random.factors[rows]
        steps: NDArray[Any] = values.astype(arithmetic.dtype, copy=False)
        steps += random.steps[rows] if len(random.steps) > 1 else random.steps
        if arithmetic.fixed_point:
            np.right_shift(steps, arithmetic.shift, out=steps)
        np.clip(steps, 0, full, out=steps)
        out[rows] = steps

    piece_values = _PIECE_VALUES if threads() <= 2 else _SHORT_VALUES
    run_in_threads(split_rows(len(flat), flat.size // piece_values), digitise_rows)
    return out.reshape(signal.shape)


def prefetch_scene_noise(scene: SceneState) -> Callable[[], ImageNoise]:
    """Draw the additive noise of a scene's image in another thread.

    Returns
    -------
    callable
        Function without arguments that waits for the `ImageNoise`, to be called once; it is for `digitise_scene`.
    """
    bands = len(bands_of(scene.bands))
    size = (scene.camera.height_px, scene.camera.width_px)
    sensor = converter(scene.sensor, scene.camera.pixel_encoding)
    return start_noise(size if bands == 1 else (*size, bands), sensor, scene.seed, scene.frame_index)


def expose_scene(scene: SceneState, radiance_w_m2_sr: Float32Array) -> Float32Array:
    """Return the noise-free signal of a drawn scene, 1 at full scale: lens, exposure, PSF.

    Parameters
    ----------
    scene : SceneState
        Scene at mid-exposure.
    radiance_w_m2_sr : (H, W) or (H, W, 3) array
        [W m-2 sr-1], row 0 at the top.

    Returns
    -------
    (H, W) or (H, W, n) array
        Signal, 1 at full scale.
    """
    conditions = ViewingConditions(
        camera=scene.camera,
        target_distance_m=float(np.linalg.norm(scene.t_camera_from_target_m)),
        sun_direction=np.array(scene.sun_direction_camera),
        sun_irradiance_w_m2=_sun_irradiance_at_camera(scene, radiance_w_m2_sr),
    )
    return expose(
        radiance_w_m2_sr,
        scene.sensor,
        scene.exposure_s,
        sunlight_balance(scene.bands),
        scene.optics,
        conditions,
    )


def digitise_scene(
    scene: SceneState,
    signal: Float32Array,
    sensor: Sensor | None = None,
    noise: Callable[[], ImageNoise] | None = None,
) -> NDArray[np.unsignedinteger]:
    """Return the digital numbers of an exposed scene, encoded as its camera delivers them.

    Parameters
    ----------
    scene : SceneState
        Scene at mid-exposure.
    signal : array
        Result of `expose_scene`.
    sensor : Sensor, optional
        Replaces the scene's, for example by its noiseless twin.
    noise : callable, optional
        Result of `prefetch_scene_noise` for the scene's own sensor.

    Returns
    -------
    (H, W) or (H, W, n) array
        Digital numbers.
    """
    sensor, encoding = sensor or scene.sensor, scene.camera.pixel_encoding
    balance = sunlight_balance(scene.bands)
    numbers = digitise(
        signal,
        converter(sensor, encoding),
        scene.seed,
        scene.frame_index,
        scene.exposure_s,
        balance if sensor.detector is None else white_balance(sensor, scene.optics, balance),
        noise,
    )
    return encode_numbers(numbers, sensor, encoding)


def _sun_irradiance_at_camera(scene: SceneState, radiance: Float32Array) -> FloatArray:
    """Return the Sun's irradiance at the camera per band, without the hidden part [W m-2].

    The visible share is that at the target, or, if the Sun's disc is in the image, that of the drawn disc.
    """
    to_sun = np.asarray(scene.r_sun_eci_m) - np.asarray(scene.r_camera_eci_m)
    irradiance = sun_irradiance_w_m2(scene.bands, float(np.linalg.norm(to_sun))) * scene.sunlit_fraction
    if scene.optics.veiling_glare_sr <= 0:
        return irradiance
    direction = np.array(scene.sun_direction_camera)
    pixel = scene.camera.project(direction)
    if scene.environment.sun and direction[2] > 0 and scene.camera.contains(pixel):
        x, y = (int(v) for v in np.rint(pixel))
        near = radiance[max(y - 2, 0) : y + 3, max(x - 2, 0) : x + 3]
        solid_angle = np.pi * (SUN_RADIUS_M / np.linalg.norm(to_sun)) ** 2
        solid_angle_sr = scene.camera.pixel_solid_angle_sr(pixel)
        brightest = near.reshape(-1, *near.shape[2:]).max(axis=0)
        full = irradiance / np.maximum(solid_angle, solid_angle_sr)
        irradiance = irradiance * np.clip(np.max(brightest / np.maximum(full, 1e-9)) * 1.5, 0, 1)
    return irradiance
