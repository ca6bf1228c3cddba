"""Check of the images: a sample is drawn again from its records and compared.

A record's hash detects accidental changes only, because anyone who alters an image can also alter its hash. The same
renderer draws the same bytes. Another renderer may round differently, so images are compared after blurring, with a
tolerance for noise and for a sub-pixel shift.
"""

from __future__ import annotations

import math
import secrets
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from flyaround.simulator.camera.detector.transfer import decode_numbers
from flyaround.simulator.dataset.check.clean_twin import band_gains
from flyaround.simulator.dataset.check.feasibility import check_step_share
from flyaround.simulator.dataset.formats.native import frame_paths, read_layer, read_png
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import take_frame
from flyaround.simulator.imaging.image_formation import expose_scene, noise_sigma
from flyaround.simulator.labels.feasible import mono_signal
from flyaround.simulator.labels.request import LabelRequest
from flyaround.simulator.labels.truth import read_truth

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from flyaround.simulator.dataset.check.ray_casting import Layers
    from flyaround.simulator.labels.truth import Truth
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import ByteArray
    from flyaround.simulator.targets.model import Target

SHARE = 0.02  # share of a data set's frames that are rendered again, at the cost of capturing them

# Minimum number of rendered frames.
MIN_FRAMES = 3

# Blur of the images before their comparison [px], which suppresses the noise.
BLUR_PX = 2.0
BLURRED_NOISE = 1 / (2 * math.sqrt(math.pi) * BLUR_PX)  # standard deviation of white noise after that blur

# Tolerated difference [standard deviations of the noise].
SIGMAS = 6.0
SHIFT_PX = 0.25  # largest shift of an edge
RELATIVE, ABSOLUTE = 0.01, 0.004  # tolerances between renderers, as shares of the signal and of full scale
MAX_OTHER, MAX_OF_MASK = 2e-4, 0.01  # share of the image's pixels, and of the craft's, that may differ
MIN_PIXELS = 4  # pixels that may differ in any image
SAME_RENDERER_TOLERANCE = 1e-6  # tolerance of statistics if the images are equal

LAYER_RELATIVE = {"depth": 2e-5}
"""Relative tolerance for another renderer or processor."""

LAYER_ABSOLUTE = {"depth": 1e-3, "normals": 0.02, "flow": 0.02, "clean": 1.0}
"""Absolute tolerance in the layer's unit: metres, 1, pixels, digital numbers."""

MAX_EDGE_PIXELS = 6
"""Number of pixels that rounding at an edge may assign to another surface; or `MAX_OF_MASK`."""


@dataclass(frozen=True)
class Redrawn:
    """Result of redrawing: number of frames, faults, and the reason if none was drawn."""

    n_frames: int
    faults: tuple[tuple[int, str], ...]
    reason: str = ""


def fresh_seed() -> int:
    """Return an unpredictable seed, short enough for any JSON reader."""
    return secrets.randbelow(2**53)


def sample(frames: Sequence[int], share: float, seed: int) -> list[int]:
    """Select the frames to draw again: a share, at least three; none for a share of zero.

    Parameters
    ----------
    frames : sequence of int
        Frames to choose from.
    share : float
        Share of the frames.
    seed : int
        Seed of the sample; it must be unpredictable for anyone who could alter the data set.
    """
    if share <= 0 or not frames:
        return []
    count = min(len(frames), max(MIN_FRAMES, math.ceil(share * len(frames))))
    selected = np.random.default_rng([seed % 2**63, len(frames)]).choice(len(frames), count, replace=False)
    return [frames[k] for k in sorted(selected.tolist())]


def check_pictures(
    folder: Path, frames: Sequence[int], target: Target, progress: Callable[[], None] = lambda: None
) -> Redrawn:
    """Draw frames again from their records, and compare.

    Parameters
    ----------
    folder : Path
        Data set.
    frames : sequence of int
        Numbers of readable frames to draw.
    target : Target
        Target named by card and records.
    progress : callable, optional
        Called after each frame.
    """
    from flyaround.simulator.render.earth.map_textures import prefetch_maps  # noqa: PLC0415 - a check without pictures needs no renderer
    from flyaround.simulator.render.renderer import Renderer  # noqa: PLC0415 - the same

    faults: list[tuple[int, str]] = []
    try:
        renderer = Renderer(prefetched=prefetch_maps(read_truth(frame_paths(folder, frames[0]).truth).scene))
    except UserError as error:
        return Redrawn(0, (), str(error))
    with renderer:
        for k in frames:
            truth = read_truth(frame_paths(folder, k).truth)  # megabytes each
            craft = truth.scene.target.drawn(target)
            if truth.scene.target.sha256 != craft.sha256:
                faults.append((k, "the scene's target is not the card's"))
                continue
            image = read_png(frame_paths(folder, k).image)
            mask = np.asarray(read_png(frame_paths(folder, k).mask), np.uint8)
            layers = {name: read_layer(folder / "images", f"{k:06d}", name) for name in truth.layer_sha256}
            frame_faults = check_drawn_again(renderer, truth, image, mask, craft, layers)
            faults += [(k, message) for message in frame_faults]
            progress()
    return Redrawn(len(frames), tuple(faults))


def check_drawn_again(
    renderer: Renderer,
    truth: Truth,
    image: NDArray[np.unsignedinteger],
    mask: ByteArray,
    target: Target,
    layers: Layers | None = None,
) -> list[str]:
    """Return all differences between a frame and its redrawn record.

    Parameters
    ----------
    renderer : Renderer
        Renderer of the images.
    truth : Truth
        Truth record of the frame.
    image : (H, W) or (H, W, 3) array
        Digital numbers of the stored image.
    mask : (H, W) array
        Mask of the target.
    target : Target
        Target model.
    layers : Layers, optional
        Label layers of the frame by name, as read.
    """
    request = LabelRequest(layers=tuple(layers or ()), flow=truth.flow)
    redrawn_frame = take_frame(renderer, truth.scene, target, labels=request if layers else False)
    problems = check_same_picture(truth, image, redrawn_frame.image, mask)
    if layers:
        is_same = np.array_equal(image, redrawn_frame.image)
        problems += check_same_layers(layers, redrawn_frame.layers, mask, is_same_renderer=is_same)
    signal = expose_scene(truth.scene, redrawn_frame.radiance)
    mono = np.asarray(mono_signal(signal), float)
    # the same renderer repeats the light exactly; another one within the tolerance of its image
    doubt, relative = (
        (SAME_RENDERER_TOLERANCE, 0.0) if np.array_equal(image, redrawn_frame.image) else (ABSOLUTE, RELATIVE)
    )
    return problems + check_step_share(truth, target, mono, doubt, relative)


def check_same_picture(
    truth: Truth,
    image: NDArray[np.unsignedinteger],
    again: NDArray[np.unsignedinteger],
    mask: ByteArray,
) -> list[str]:
    """Check that an image equals the redrawn one, within the noise and a renderer's rounding."""
    if image.shape != again.shape or image.dtype != again.dtype:
        return [f"the image is {image.shape} {image.dtype}, drawn again {again.shape} {again.dtype}"]
    if np.array_equal(image, again):
        return []
    encoding = truth.camera.pixel_encoding
    (one, sensor), (two, _) = (decode_numbers(x, truth.scene.sensor, encoding) for x in (image, again))
    full, black = sensor.scale_dn  # a detector saturates at its full well, above its black level
    read, redrawn = (
        cv2.GaussianBlur((x.astype(np.float32) - black) / full, (0, 0), BLUR_PX) for x in (one, two)
    )
    difference = np.abs(read - redrawn)
    levels = np.linspace(0, 1, 33)
    sigma = np.array([noise_sigma(sensor, float(x), truth.scene.exposure_s) for x in levels])
    # demosaicing spreads the noise of one pixel in four over all, so a blur reduces it less; white balance and a colour
    # matrix multiply it
    spread = np.maximum(3.0, 2.0 * np.linalg.norm(band_gains(truth), axis=1)) if image.ndim == 3 else 1.0
    noise = np.interp(redrawn, levels, sigma) * (SIGMAS * math.sqrt(2) * BLURRED_NOISE * spread)
    near = np.ones((3, 3), np.uint8)
    slope = cv2.dilate(redrawn, near) - cv2.erode(redrawn, near)
    is_wrong = difference > ABSOLUTE + RELATIVE * np.maximum(redrawn, 0) + noise + SHIFT_PX * slope
    is_wrong = is_wrong if is_wrong.ndim == 2 else is_wrong.any(axis=2)
    near_craft = cv2.dilate(mask, np.ones((9, 9), np.uint8)) > 0
    on_craft, off_craft = (int(np.count_nonzero(is_wrong & where)) for where in (near_craft, ~near_craft))
    if on_craft <= max(MAX_OF_MASK * np.count_nonzero(mask), MIN_PIXELS) and off_craft <= max(
        MAX_OTHER * is_wrong.size, MIN_PIXELS
    ):
        return []
    message = (
        f"the image differs from the one rendered again from its record: {on_craft + off_craft} pixels differ by more "
        "than noise and rounding"
    )
    return [message]


def check_same_layers(
    layers: Mapping[str, NDArray[Any]],
    again: Mapping[str, NDArray[Any]],
    mask: ByteArray,
    *,
    is_same_renderer: bool,
) -> list[str]:
    """Compare the layers of a frame with redrawn ones.

    Parameters
    ----------
    layers : mapping
        Layers as read, by name.
    again : mapping
        Layers as drawn again, by name.
    mask : (H, W) array
        Mask of the target.
    is_same_renderer : bool
        True if the image is equal to the byte, so that only rounding at few pixels is allowed.
    """
    allowed = (
        MAX_EDGE_PIXELS if is_same_renderer else max(MAX_EDGE_PIXELS, MAX_OF_MASK * np.count_nonzero(mask))
    )
    problems = []
    for name in sorted(layers.keys() & again.keys()):
        read, redrawn = layers[name], again[name]
        if not is_same_renderer and (name == "clean" or read.shape != redrawn.shape):
            continue  # under another renderer the light differs, and the amodal mask may begin elsewhere
        if read.shape != redrawn.shape:
            problems.append(f"{name} is {read.shape}, drawn again {redrawn.shape}")
            continue
        bad = _differing(name, read, redrawn)
        if bad > allowed:
            problems.append(f"{name} differs at {bad} pixels from the layer rendered again from its record")
    return problems


def _differing(name: str, read: NDArray[Any], redrawn: NDArray[Any]) -> int:
    """Count the pixels that differ by more than rounding."""
    if np.array_equal(read, redrawn, equal_nan=read.dtype.kind == "f"):
        return 0
    a, b = read.astype(np.float64), redrawn.astype(np.float64)
    # NaN and a number differ, and so do two values that are too far apart
    near = np.abs(a - b) <= LAYER_ABSOLUTE.get(name, 0.0) + LAYER_RELATIVE.get(name, 0.0) * np.abs(b)
    bad = ~(near | (np.isnan(a) & np.isnan(b)))
    return int(np.count_nonzero(bad if bad.ndim == 2 else bad.any(axis=2)))
