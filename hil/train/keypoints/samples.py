"""Training samples of the keypoint network: views with random light, background, crop, exposure and noise.

*Orbit* samples show the target in sunlight, in front of the Earth or of space. *Laboratory* samples show it under
lamps, with randomised surfaces, background and camera errors, so that the network does not depend on the rendering
(domain randomisation; after Park & D'Amico 2024, Robust multi-task learning and online refinement for spacecraft pose
estimation across domain gap). Ranges without a source were chosen by hand; `tools.studies.randomisation` compares
trainings without each of them (docs/lab/2026-11-keypoint-network.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from flyaround.hil.board.hybrid.propose.keypoints.network_input import INPUT_FILL, INPUT_PX, channels
from flyaround.hil.train.keypoints.views import FILL_SHARE, MAX_LABEL, SUNS, VIEW_PX, focal_length_px
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.random import Generator
    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array, FloatArray

# Share of laboratory samples with the Earth in the background, and share of all samples without a target.
LAB_EARTH_SHARE, EMPTY_SHARE = 0.4, 0.08

# Range of the log size: logarithm of the target's size over the size that the crop assumes.
LOG_SIZES = (-1.1, 0.7)

# Pixels of the SPEED camera per input pixel, times range over radius.
PIXELS_PER_INPUT_PIXEL = 65.0

# Width and height of an image [px of the SPEED camera].
FRAME_PX = (1920.0, 1200.0)

# Maximum error of the logarithm of a grossly wrong exposure.
MAX_EXPOSURE_ERROR = 2 * float(np.log(2.0))

# Standard deviation of the deformation [px], and its correlation length [px].
DEFORMATION_PX, DEFORMATION_SCALE_PX = 1.2, 20.0

# Signal at which a view is clipped [full scale]; brighter highlights saturate any exposure.
MAX_SIGNAL = 12.0

# Coordinates of the pixels of a view and of an input, -1..1.
_Y, _X = (np.mgrid[:VIEW_PX, :VIEW_PX] / (0.5 * VIEW_PX) - 1.0).astype(np.float32)
_V, _U = (np.mgrid[:INPUT_PX, :INPUT_PX] / (0.5 * INPUT_PX) - 1.0).astype(np.float32)


@dataclass(frozen=True)
class SampleMix:
    """Distribution of the training samples.

    Parameters
    ----------
    crop_sigmas : tuple of (float, float)
        Standard deviations of a crop's shift [half sides] and log size, for the first and later passes.
    pass_shares : tuple of float
        Shares of samples from each of these passes.
    orbit_share : float
        Share of orbit samples.
    earth_share : float
        Share of orbit samples with the Earth in the background.
    misexposed_share : float
        Share of orbit samples with a grossly wrong exposure.
    noise : tuple of float, optional
        Range of the noise per pixel [full scale].
    noise_log_error : tuple of float
        Range of the logarithm of the measured noise over the true one.
    exposure_sigma : float
        Standard deviation of the logarithm of the exposure of the other orbit samples.
    level_sigma : float
        Standard deviation of the logarithm of the signal to which a laboratory sample's surface is exposed.
    level_ranks : tuple of float
        Range of the quantile of the surface's signal that is exposed to this level.
    lamps : tuple of float
        Shares of the lights that are on in a laboratory sample; at least one is.
    ambient : tuple of float
        Ambient light in a laboratory sample, relative to the brightest surface.
    surface_spreads : tuple of float
        Range of the standard deviation of the logarithm of a laboratory sample's surface brightnesses.
    surface_slopes : tuple of float
        Range of the standard deviation of their slopes across the view, which are also those of a lamp's beam.
    mirror_share : float
        Share of a laboratory sample's surfaces that mirror a lamp.
    texture_share : float
        Share of the laboratory samples with a texture on the target.
    cable_share : float
        Share of them with cables or bars across the image.
    deformed_share : float
        Share of them with a deformed target.
    stray_light_share : float
        Share of them with stray light.
    occluded_share : float
        Share of them with a part of the target occluded.
    jpeg_share : float
        Share of them compressed by JPEG.
    hot_pixel_share : float
        Share of them with hot pixels.
    glow_share : float
        Share of them with glow about bright surfaces.
    blur_share : float
        Share of them with blur.
    shadow_share : float
        Share of samples with a shadow across the image.
    """

    crop_sigmas: tuple[tuple[float, float], ...] = ((0.28, 0.42), (0.12, 0.2), (0.04, 0.08))
    pass_shares: tuple[float, ...] = (0.25, 0.3, 0.45)
    orbit_share: float = 0.4
    earth_share: float = 0.65
    misexposed_share: float = 0.3
    noise: tuple[float, float] = (0.002, 0.075)
    noise_log_error: tuple[float, float] = (-0.1, 0.5)
    exposure_sigma: float = 0.4
    level_sigma: float = 0.7
    level_ranks: tuple[float, float] = (0.5, 0.995)
    lamps: tuple[float, ...] = (0.0, 0.3, 0.6, 1.0)
    ambient: tuple[float, ...] = (0.0, 0.01, 0.04)
    surface_spreads: tuple[float, float] = (0.05, 0.7)
    surface_slopes: tuple[float, float] = (0.0, 1.2)
    mirror_share: float = 0.06
    texture_share: float = 0.3
    cable_share: float = 0.3
    deformed_share: float = 0.3
    stray_light_share: float = 0.25
    occluded_share: float = 0.2
    jpeg_share: float = 0.2
    hot_pixel_share: float = 0.4
    glow_share: float = 0.6
    blur_share: float = 0.5
    shadow_share: float = 0.08


# Full range of conditions, and an easier curriculum for the start: from random weights, attitudes are then learned much
# sooner (docs/lab/2026-11-keypoint-network.md).
HARD = SampleMix()
EASY = SampleMix(((0.1, 0.15), (0.06, 0.1), (0.03, 0.05)), (0.2, 0.3, 0.5), 0.75, 0.25, 0.1, (0.002, 0.02))


@dataclass(frozen=True, eq=False)
class LitViews:
    """Stacked views of one target.

    Parameters
    ----------
    lit : (N, LIGHTS, S, S) array
        Square root of the signal relative to each light's largest one, scaled to 255, uint8.
    scale : (N, LIGHTS) array
        Largest signal under each light [full scale], float32.
    cover : (N, S, S) array
        Share of the pixel covered by the target, scaled to 255, uint8.
    label : (N, S, S) array
        Surface label of each pixel, 0 for the background, uint8.
    q_wxyz : (N, 4) array
        Attitude quaternions, camera from target.
    range_in_radii : (N,) array
        Ranges [radii of the bounding sphere].
    keypoints : (K, 3) array
        Keypoints relative to the sphere's centre, target frame [radii].
    """

    lit: ByteArray
    scale: Float32Array
    cover: ByteArray
    label: ByteArray
    q_wxyz: FloatArray
    range_in_radii: FloatArray
    keypoints: FloatArray


@dataclass(frozen=True, eq=False)
class Batch:
    """Network inputs with their ground truth.

    Parameters
    ----------
    inputs : (B, 2, S, S) array
        Inputs, float16.
    points : (B, K, 2) array
        Keypoints relative to the centre of the input [half sides].
    present : (B,) array
        1 if a target is present, else 0.
    log_size : (B,) array
        Logarithm of the target's size over the size that the crop assumes.
    """

    inputs: NDArray[np.float16]
    points: Float32Array
    present: Float32Array
    log_size: Float32Array


def image_pyramid(earths: Float32Array, levels: int = 3) -> tuple[Float32Array, ...]:
    """Return an image pyramid of the backgrounds.

    Returns
    -------
    tuple of (M, h, w) array
        Levels, float32, finest first: each has half the size of the previous one by averaging.
    """
    out = [np.asarray(earths, np.float32)]
    for _ in range(levels - 1):
        n, h, w = out[-1].shape
        out.append(out[-1].reshape(n, h // 2, 2, w // 2, 2).mean(axis=(2, 4)))
    return tuple(out)


def sample(
    views: LitViews,
    earths: Sequence[Float32Array],
    view_indices: NDArray[Any],
    rng: Generator,
    mix: SampleMix = HARD,
) -> Batch:
    """Make a batch with one sample of each of the given views.

    Parameters
    ----------
    views : LitViews
        Views of one target.
    earths : sequence of (M, h, w) array
        Image pyramid of the backgrounds.
    view_indices : (B,) array
        Indices of the views.
    rng : Generator
        Random generator.
    mix : SampleMix
        Distribution of the samples.

    Returns
    -------
    Batch
        Samples in the order of ``view_indices``; in some of them no target is present.
    """
    size = len(view_indices)
    # shift of the target in the crop [half sides], and log size
    crop_sigmas = np.array(mix.crop_sigmas)[rng.choice(len(mix.crop_sigmas), size, p=mix.pass_shares)]
    crop = rng.normal(0, 1, (size, 3)) * crop_sigmas[:, [0, 0, 1]]
    crop[:, 2] = np.clip(crop[:, 2], *LOG_SIZES)
    present = rng.random(size) >= EMPTY_SHARE
    empty = np.flatnonzero(~present)
    crop[empty, :2] = rng.uniform(1.0, 2.2, (len(empty), 2)) * rng.choice([-1, 1], (len(empty), 2))
    reduction = (
        PIXELS_PER_INPUT_PIXEL
        / views.range_in_radii[view_indices]
        * np.exp(-crop[:, 2])
        * rng.uniform(0.7, 1.4, size)
    )
    turn = rng.uniform(0, 2 * np.pi, size)
    is_orbit = rng.random(size) < mix.orbit_share
    noise = rng.uniform(*mix.noise, size)
    input_noise = (noise / np.maximum(reduction, 1.0)).astype(np.float32)
    pictures = np.empty((size, INPUT_PX, INPUT_PX), np.float32)
    points = np.empty((size, len(views.keypoints), 2), np.float32)
    for i, k in enumerate(view_indices):
        M = _affine(turn[i], crop[i])
        signal = _orbit_signal(views, k, rng) if is_orbit[i] else _laboratory_signal(views, k, rng, mix)
        picture, cover = _warp(signal, views.cover[k], M, float(np.exp(crop[i, 2])))
        compose = _orbit_picture if is_orbit[i] else _laboratory_picture
        picture = compose(picture, cover, earths, reduction[i], bool(present[i]), noise[i], rng, mix)
        picture += rng.standard_normal(picture.shape, np.float32) * input_noise[i]
        if not is_orbit[i] and rng.random() < mix.jpeg_share:
            picture = _compress(picture, rng)
        pictures[i] = _replicate_border(picture, reduction[i], crop[i], rng)
        points[i] = _keypoint_pixels(views, k) @ M[:, :2].T + M[:, 2]
    points = (points - 0.5 * (INPUT_PX - 1)) / (0.5 * INPUT_PX)
    noise_error = np.exp(rng.uniform(*mix.noise_log_error, size)).astype(np.float32)
    inputs = channels(pictures, input_noise * noise_error)
    return Batch(
        inputs.astype(np.float16),
        points.astype(np.float32),
        present.astype(np.float32),
        crop[:, 2].astype(np.float32),
    )


def _keypoint_pixels(views: LitViews, k: int) -> FloatArray:
    """Return the pixels (K, 2) of the keypoints in a view."""
    p = views.keypoints @ matrix_from_quat(views.q_wxyz[k]).T
    view_range = views.range_in_radii[k]
    f = float(focal_length_px(view_range))
    return f * p[:, :2] / (p[:, 2:] + view_range) + 0.5 * (VIEW_PX - 1)


def _affine(turn: float, crop: FloatArray) -> FloatArray:
    """Return the affine map (2, 3) from a view's pixels to the input's, for a roll angle [rad] and a crop (3,)."""
    scale = INPUT_FILL * INPUT_PX * np.exp(crop[2]) / (FILL_SHARE * VIEW_PX)
    c, s = scale * np.cos(turn), scale * np.sin(turn)
    middle, centre = 0.5 * (VIEW_PX - 1), 0.5 * (INPUT_PX - 1) + 0.5 * INPUT_PX * crop[:2]
    return np.array([[c, -s, centre[0] - (c - s) * middle], [s, c, centre[1] - (c + s) * middle]])


def _warp(
    signal: Float32Array, cover: ByteArray, M: FloatArray, size: float
) -> tuple[Float32Array, Float32Array]:
    """Return the signal and coverage of a view, resampled to the input by the affine map ``M``."""
    scale = INPUT_FILL * INPUT_PX * size / (FILL_SHARE * VIEW_PX)
    both = np.dstack([np.minimum(signal, np.float32(MAX_SIGNAL)), cover.astype(np.float32) / np.float32(255)])
    blur = 0.5 * float(np.sqrt(max(1 / scale**2 - 0.5, 0.05)))
    soft = cv2.GaussianBlur(both, (0, 0), blur)
    out = cv2.warpAffine(soft, M, (INPUT_PX, INPUT_PX), flags=cv2.INTER_LINEAR)
    return np.ascontiguousarray(out[..., 0]), np.ascontiguousarray(out[..., 1])


def _mix_lights(views: LitViews, k: int, weights: FloatArray) -> Float32Array:
    """Return the target's signal (S, S) under a weighted sum of its lights [full scale]."""
    total = np.zeros((VIEW_PX, VIEW_PX), np.float32)
    for j in np.flatnonzero(weights):
        signal = views.lit[k, j].astype(np.float32)
        signal *= signal
        signal *= np.float32(weights[j] * views.scale[k, j] / 255.0**2)
        total += signal
    return total


def _orbit_signal(views: LitViews, k: int, rng: Generator) -> Float32Array:
    """Return the target in sunlight with some Earthshine."""
    lights = views.lit.shape[1]
    weights = np.full(lights, rng.uniform(0.0, 0.02))
    weights[rng.integers(min(lights, SUNS))] = 1.0
    return _mix_lights(views, k, weights)


def _laboratory_signal(views: LitViews, k: int, rng: Generator, mix: SampleMix) -> Float32Array:
    """Return the target under several lamps, with other surfaces than in the model, a random share saturated."""
    lights = views.lit.shape[1]
    weights = np.exp(rng.normal(0, 1.5, lights)) * (rng.random(lights) < rng.choice(mix.lamps))
    if not weights.any():
        weights[rng.integers(lights)] = 1.0
    signal = _mix_lights(views, k, weights)
    # other surface brightnesses and specular reflections of a lamp; each surface with its own fall-off
    spread, tilt = rng.uniform(*mix.surface_spreads), rng.uniform(*mix.surface_slopes)
    log_gain = rng.normal(0, spread, MAX_LABEL)
    mirror = rng.random(MAX_LABEL) < mix.mirror_share
    log_gain[mirror] += rng.uniform(0.5, 3.0, int(mirror.sum()))
    a, b = (
        rng.normal(0, tilt, MAX_LABEL).astype(np.float32) + np.float32(rng.normal(0, 0.5)) for _ in range(2)
    )
    label = views.label[k]
    field = log_gain.astype(np.float32)[label] + a[label] * _X + b[label] * _Y
    # ambient light: shadows are not quite black, equal for all surfaces
    floor = np.float32(rng.choice(mix.ambient) * float(signal.max()))
    signal = (signal + floor * (label > 0)) * np.exp(np.clip(field, -3, 3))
    surface = signal[views.cover[k] > 128]
    if not len(surface):
        return signal
    # normalise a quantile of the visible surface to a random level: from little light to half of the target saturated
    level = float(np.exp(rng.normal(np.log(0.7), mix.level_sigma)))
    rank = int(rng.uniform(*mix.level_ranks) * (len(surface) - 1))
    return signal * np.float32(level / max(float(np.partition(surface, rank)[rank]), 1e-4))


def _orbit_picture(
    signal: Float32Array,
    cover: Float32Array,
    earths: Sequence[Float32Array],
    reduction: float,
    present: bool,  # noqa: FBT001 - positional in a private call
    noise: float,
    rng: Generator,
    mix: SampleMix,
) -> Float32Array:
    misexposed = rng.random() < mix.misexposed_share
    gain = np.float32(
        np.exp(
            rng.uniform(-MAX_EXPOSURE_ERROR, MAX_EXPOSURE_ERROR)
            if misexposed
            else rng.normal(0, mix.exposure_sigma)
        )
    )
    picture = _add_shadow(signal, rng, mix.shadow_share) * gain
    if not present or rng.random() < mix.earth_share:
        earth = _window(earths, reduction / 4, rng)
        picture = picture + (1 - cover) * earth * np.float32(gain * rng.uniform(0.6, 1.4))
    # clipping at black and white: noise on black raises the mean
    raised = np.float32(0.8 * noise)
    return np.minimum(0.5 * (picture + np.sqrt(picture * picture + raised * raised)), 1.0)


def _laboratory_picture(
    signal: Float32Array,
    cover: Float32Array,
    earths: Sequence[Float32Array],
    reduction: float,
    present: bool,  # noqa: FBT001 - positional in a private call
    _noise: float,
    rng: Generator,
    mix: SampleMix,
) -> Float32Array:
    picture = np.minimum(_add_shadow(signal, rng, mix.shadow_share), np.float32(MAX_SIGNAL))
    if rng.random() < mix.texture_share:
        texture = _window(earths, reduction / 4 * rng.uniform(0.25, 1.0), rng)
        texture = (texture - texture.mean()) / max(float(texture.std()), 1e-3)
        strength = np.float32(rng.uniform(0.1, 0.7))
        picture = picture * np.exp(strength * np.clip(texture, -2.5, 2.5) * cover)
    if rng.random() < mix.cable_share:
        _draw_cables(picture, rng)
    if not present or rng.random() < LAB_EARTH_SHARE:
        background = _window(earths, reduction / 4 * rng.uniform(0.5, 2.0), rng)
        background = background ** np.float32(rng.uniform(0.6, 1.6)) * np.float32(
            np.exp(rng.uniform(-2.5, 0.8))
        )
        picture = picture + (1 - cover) * background
    for _ in range(rng.integers(4) if rng.random() < mix.hot_pixel_share else 0):
        cv2.circle(picture, rng.integers(INPUT_PX, size=2).tolist(), 1, float(rng.uniform(0.1, 0.8)), -1)
    if rng.random() < mix.occluded_share:
        # an occluding object of any brightness
        x, y = rng.integers(INPUT_PX, size=2)
        w, h = rng.integers(8, 48, size=2)
        picture[y : y + h, x : x + w] = rng.choice([0.0, rng.uniform(0, 1.2)])
    if rng.random() < mix.deformed_share:
        picture = _deform(picture, rng)
    if rng.random() < mix.glow_share:
        small = cv2.resize(picture, (INPUT_PX // 4, INPUT_PX // 4), interpolation=cv2.INTER_AREA)
        glow = cv2.GaussianBlur(small, (0, 0), float(rng.uniform(0.8, 4.5)))
        wide = cv2.resize(glow, (INPUT_PX, INPUT_PX), interpolation=cv2.INTER_LINEAR)
        picture = picture + np.float32(rng.uniform(0.0, 0.12)) * wide
    if rng.random() < mix.blur_share:
        picture = cv2.GaussianBlur(picture, (0, 0), float(rng.uniform(0.4, 1.8)))
    picture = np.clip(picture, 0.0, 1.0) ** np.float32(np.exp(rng.normal(0, 0.2)))
    if rng.random() < mix.stray_light_share:
        a = rng.uniform(0, 2 * np.pi)
        ramp = np.clip(0.5 + 0.5 * (np.float32(np.cos(a)) * _U + np.float32(np.sin(a)) * _V), 0, 1)
        picture = picture + np.float32(rng.uniform(0.0, 0.2)) * ramp ** np.float32(rng.uniform(0.5, 4.0))
    # residual of a subtracted black level
    return np.minimum(picture + np.float32(max(rng.normal(0, 0.03), 0.0)), np.float32(1.0))


def _compress(picture: Float32Array, rng: Generator) -> Float32Array:
    """Return the image after JPEG compression."""
    pixels = np.clip(np.rint(255 * picture), 0, 255).astype(np.uint8)
    _, coded = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(40, 96))])
    decoded = np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE))
    return decoded.astype(np.float32) / np.float32(255)


def _draw_cables(picture: Float32Array, rng: Generator) -> None:
    """Draw bars and cables across the image."""
    top = max(float(picture.max()), 1e-3)
    for _ in range(int(rng.integers(1, 5))):
        middle = 0.5 * INPUT_PX + rng.normal(0, 0.2 * INPUT_PX, 2)
        half = rng.normal(0, 0.12 * INPUT_PX, 2)
        a, b = np.rint(middle - half).astype(int).tolist(), np.rint(middle + half).astype(int).tolist()
        bright = top * float(rng.choice([0.0, rng.uniform(0, 1)]))
        cv2.line(picture, a, b, bright, int(rng.integers(1, 4)), cv2.LINE_AA)


def _deform(picture: Float32Array, rng: Generator) -> Float32Array:
    """Return the image with a smooth random deformation."""
    coarse = INPUT_PX // 8
    pixels = np.mgrid[:INPUT_PX, :INPUT_PX][::-1].astype(np.float32)
    for k in range(2):
        smooth = cv2.GaussianBlur(
            rng.standard_normal((coarse, coarse), np.float32),
            (0, 0),
            DEFORMATION_SCALE_PX * coarse / INPUT_PX,
        )
        wide = cv2.resize(smooth, (INPUT_PX, INPUT_PX), interpolation=cv2.INTER_CUBIC)
        pixels[k] += wide * np.float32(DEFORMATION_PX / max(float(smooth.std()), 1e-6))
    return np.asarray(
        cv2.remap(picture, pixels[0], pixels[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    )


def _add_shadow(signal: Float32Array, rng: Generator, share: float) -> Float32Array:
    """Return the signal, sometimes with a straight shadow edge over a part of it."""
    if rng.random() > share:
        return signal
    angle, edge = rng.uniform(0, 2 * np.pi), rng.uniform(-0.25, 0.25)
    dark = np.float32(np.cos(angle)) * _U + np.float32(np.sin(angle)) * _V > edge
    return np.where(dark, signal * np.float32(rng.uniform(0.02, 0.4)), signal)


def _window(earths: Sequence[Float32Array], reduction: float, rng: Generator) -> Float32Array:
    """Return a random window of a background, downscaled by ``reduction`` and rotated by a multiple of 90 deg."""
    level = int(np.clip(np.log2(max(reduction, 1.0)), 0, len(earths) - 1))
    earth = earths[level][int(rng.integers(len(earths[level])))]
    h, w = earth.shape
    side = int(np.clip(INPUT_PX * reduction / 2**level, min(INPUT_PX // 2, h), min(h, w)))
    x, y = int(rng.integers(w - side + 1)), int(rng.integers(h - side + 1))
    interpolation = cv2.INTER_AREA if side > INPUT_PX else cv2.INTER_LINEAR
    window = cv2.resize(earth[y : y + side, x : x + side], (INPUT_PX, INPUT_PX), interpolation=interpolation)
    window = np.rot90(window, int(rng.integers(4)))
    return np.asarray(window.T if rng.random() < 0.5 else window)


def _replicate_border(
    picture: Float32Array, reduction: float, crop: FloatArray, rng: Generator
) -> Float32Array:
    """Return the image with its border replicated where the crop extends beyond the frame, as on the board.

    The bounding sphere is placed randomly in the frame, or near its centre if it is larger.
    """
    indices = []
    for size_px, shift in zip(FRAME_PX, crop[:2], strict=True):
        half = 0.5 * size_px / reduction
        slack = max(half - 0.5 * INPUT_FILL * INPUT_PX * float(np.exp(crop[2])), 0.0)
        middle = 0.5 * (INPUT_PX - 1) + 0.5 * INPUT_PX * shift + slack * rng.uniform(-1, 1)
        low = int(np.clip(np.ceil(middle - half), 0, INPUT_PX - 1))
        high = int(np.clip(np.floor(middle + half), low, INPUT_PX - 1))
        indices.append(np.clip(np.arange(INPUT_PX), low, high))
    return picture[indices[1][:, None], indices[0][None, :]]
