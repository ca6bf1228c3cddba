"""Training samples of the learned proposal: views on a background, turned, moved, exposed and made noisy by chance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.propose.learned.network import INPUT_FILL, INPUT_PX, contrast
from tools.train.proposal_views import FILLED as VIEW_FILLED
from tools.train.proposal_views import VIEW_PX

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray

# Shares of samples with the Earth behind, and without a craft.
EARTH_SHARE, EMPTY_SHARE = 0.65, 0.1

# How far a start is off, as the first proposal, the second and the later ones find it: shift [half sides] and logarithm
# of the size, standard deviations; and how often each is shown.
OFF, SHOWN = ((0.28, 0.42), (0.12, 0.2), (0.04, 0.08)), (0.25, 0.3, 0.45)

# Craft that appear smaller or larger than by this are not shown [log].
SIZES = (-1.1, 0.8)

# Noise of one full pixel [full scale]; pixels of the SPEED camera per pixel of a look, times range over radius.
NOISE, REDUCED = (0.002, 0.075), 130.0

# Width and height of a picture, in pixels of the SPEED camera.
FRAME_PX = (1920.0, 1200.0)

# Exposures: most are near the right one, some are off by two stops [log].
EXPOSED, ASTRAY, ASTRAY_SHARE = 0.4, 2 * float(np.log(2.0)), 0.3

# How the noise of a picture may be measured, over the true one [log].
MISMEASURED = (-0.1, 0.5)


@dataclass(frozen=True, eq=False)
class Views:
    """What `proposal_views` wrote.

    Parameters
    ----------
    earths : backgrounds, then the same at halves of the size.
    """

    signal: Float32Array
    cover: NDArray[np.uint8]
    q_wxyz: FloatArray
    range_in_radii: FloatArray
    earths: tuple[Float32Array, ...]

    @staticmethod
    def read(folder: Path, first: int, last: int) -> Views:
        """Views ``first`` to ``last`` of a folder, all of its backgrounds."""
        pose = np.load(folder / "pose.npy", mmap_mode="r")[first:last].astype(float)
        earths = [np.load(folder / "earths.npy").astype(np.float32)]
        for _ in range(2):
            last_one = earths[-1]
            n, h, w = last_one.shape
            earths.append(last_one.reshape(n, h // 2, 2, w // 2, 2).mean(axis=(2, 4)))
        return Views(
            np.load(folder / "views.npy", mmap_mode="r")[first:last].astype(np.float32),
            np.array(np.load(folder / "cover.npy", mmap_mode="r")[first:last]),
            pose[:, :4],
            pose[:, 4],
            tuple(earths),
        )


@dataclass(frozen=True, eq=False)
class Batch:
    """Looks and what the network should say of them.

    Parameters
    ----------
    inputs : (B, 64, 64, 2). q_wxyz : (B, 4) against the line of sight.
    box : (B, 3) centre of the craft's sphere from the middle [half sides], logarithm of its size over the right one.
    craft : (B,) 1 where there is one.
    """

    inputs: Float32Array
    q_wxyz: FloatArray
    box: FloatArray
    craft: FloatArray


def sample(views: Views, rng: np.random.Generator, size: int) -> Batch:
    """A batch of random inputs."""
    which = rng.integers(len(views.signal), size=size)
    off = np.array(OFF)[rng.choice(len(OFF), size, p=SHOWN)]
    box = rng.normal(0, 1, (size, 3)) * off[:, [0, 0, 1]]
    box[:, 2] = np.clip(box[:, 2], *SIZES)
    craft = (rng.random(size) >= EMPTY_SHARE).astype(float)
    # a look without a craft may hold the edge of one
    empty = np.flatnonzero(craft == 0)
    box[empty, :2] = rng.uniform(1.0, 2.2, (len(empty), 2)) * rng.choice([-1, 1], (len(empty), 2))
    reduced = REDUCED / views.range_in_radii[which] * np.exp(-box[:, 2]) * rng.uniform(0.7, 1.4, size)
    turn = rng.uniform(0, 2 * np.pi, size)
    gain = np.exp(
        np.where(
            rng.random(size) < ASTRAY_SHARE,
            rng.uniform(-ASTRAY, ASTRAY, size),
            rng.normal(0, EXPOSED, size),
        )
    )
    noise = rng.uniform(*NOISE, size)
    pictures = np.empty((size, INPUT_PX, INPUT_PX), np.float32)
    for i in range(size):
        k = which[i]
        signal, cover = _warped(views.signal[k], views.cover[k], turn[i], box[i])
        signal = shadowed(signal, rng) * np.float32(gain[i])
        if craft[i] == 0.0 or rng.random() < EARTH_SHARE:
            earth = window(views.earths, reduced[i] / 4, rng)
            signal += (1 - cover) * earth * np.float32(gain[i] * rng.uniform(0.6, 1.4))
        pictures[i] = signal
    # below black and above white there is nothing: noise on black lifts its mean
    lifted = np.float32(0.8) * noise.astype(np.float32)[:, None, None]
    pictures = np.minimum(0.5 * (pictures + np.sqrt(pictures * pictures + lifted * lifted)), 1.0)
    # a look that is finer than the picture has the noise of one of its pixels
    fine = (noise / np.maximum(reduced, 1.0)).astype(np.float32)
    pictures += rng.standard_normal(pictures.shape, np.float32) * fine[:, None, None]
    for i in range(size):
        pictures[i] = framed(pictures[i], reduced[i], box[i], rng)
    inputs = contrast(pictures, fine * np.exp(rng.uniform(*MISMEASURED, size)).astype(np.float32))
    about = np.stack([np.cos(turn / 2), 0 * turn, 0 * turn, np.sin(turn / 2)], axis=-1)
    return Batch(inputs, quat.multiply(about, views.q_wxyz[which]), box, craft)


def _warped(
    signal: Float32Array, cover: NDArray[np.uint8], turn: float, box: FloatArray
) -> tuple[Float32Array, Float32Array]:
    scale = INPUT_FILL * INPUT_PX * np.exp(box[2]) / (VIEW_FILLED * VIEW_PX)
    c, s = scale * np.cos(turn), scale * np.sin(turn)
    middle, to = 0.5 * (VIEW_PX - 1), 0.5 * (INPUT_PX - 1) + 0.5 * INPUT_PX * box[:2]
    M = np.array([[c, -s, to[0] - (c - s) * middle], [s, c, to[1] - (c + s) * middle]])
    both = np.dstack([signal, cover.astype(np.float32) / np.float32(255)])
    blur = 0.5 * float(np.sqrt(max(1 / scale**2 - 0.8, 0.05)))
    soft = cv2.GaussianBlur(both, (0, 0), blur)
    out = cv2.warpAffine(soft, M, (INPUT_PX, INPUT_PX), flags=cv2.INTER_LINEAR)
    return np.ascontiguousarray(out[..., 0]), np.ascontiguousarray(out[..., 1])


def shadowed(signal: Float32Array, rng: np.random.Generator) -> Float32Array:
    """Now and then a straight shadow over a part."""
    if rng.random() > 0.08:
        return signal
    angle, at = rng.uniform(0, 2 * np.pi), rng.uniform(-8, 8)
    y, x = np.mgrid[:INPUT_PX, :INPUT_PX] - 0.5 * (INPUT_PX - 1)
    dark = np.cos(angle) * x + np.sin(angle) * y > at
    return np.where(dark, signal * rng.uniform(0.02, 0.4), signal).astype(np.float32)


def window(earths: tuple[Float32Array, ...], reduced: float, rng: np.random.Generator) -> Float32Array:
    """A random part of a background, ``reduced`` of its pixels per pixel, turned by quarters."""
    level = int(np.clip(np.log2(max(reduced, 1.0)), 0, len(earths) - 1))
    earth = earths[level][int(rng.integers(len(earths[level])))]
    h, w = earth.shape
    side = int(np.clip(INPUT_PX * reduced / 2**level, min(INPUT_PX, h), min(h, w)))
    x, y = int(rng.integers(w - side + 1)), int(rng.integers(h - side + 1))
    part = cv2.resize(earth[y : y + side, x : x + side], (INPUT_PX, INPUT_PX), interpolation=cv2.INTER_AREA)
    part = np.rot90(part, int(rng.integers(4)))
    return np.asarray(part.T if rng.random() < 0.5 else part)


def framed(picture: Float32Array, reduced: float, box: FloatArray, rng: np.random.Generator) -> Float32Array:
    """Where a look reaches beyond the picture, the picture's edge goes on, as the board has it.

    The craft's sphere is somewhere in the frame, or about its middle where it is larger.
    """
    at = []
    for size_px, shift in zip(FRAME_PX, box[:2], strict=True):
        half = 0.5 * size_px / reduced
        slack = max(half - 0.5 * INPUT_FILL * INPUT_PX * float(np.exp(box[2])), 0.0)
        middle = 0.5 * (INPUT_PX - 1) + 0.5 * INPUT_PX * shift + slack * rng.uniform(-1, 1)
        low = int(np.clip(np.ceil(middle - half), 0, INPUT_PX - 1))
        high = int(np.clip(np.floor(middle + half), low, INPUT_PX - 1))
        at.append(np.clip(np.arange(INPUT_PX), low, high))
    return picture[at[1][:, None], at[0][None, :]]
