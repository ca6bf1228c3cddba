"""Training samples of the first look: views laid on a background, turned, moved, exposed and made noisy by chance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from hil.board.svd import quaternion as quat
from hil.board.svd.look.net import FILLED, LOOK_PX, contrast
from hil.evaluate.first_look_pictures import FILLED as VIEW_FILLED
from hil.evaluate.first_look_pictures import VIEW_PX

if TYPE_CHECKING:
    from pathlib import Path

    from simulator.arrays import Float32Array, FloatArray

# Shares of samples with the Earth behind, and without a craft.
EARTH_SHARE, EMPTY_SHARE = 0.6, 0.12

# Noise of one full pixel at most [full scale]; pixels of the SPEED camera per pixel of a look, times range over radius.
NOISE, REDUCED = 0.065, 130.0


@dataclass(frozen=True, eq=False)
class Views:
    """What `first_look_pictures` wrote."""

    signal: Float32Array
    cover: np.typing.NDArray[np.uint8]
    q_wxyz: FloatArray
    range_in_radii: FloatArray
    earths: Float32Array

    @staticmethod
    def read(folder: Path, first: int, last: int) -> Views:
        """Views ``first`` to ``last`` of a folder, all of its backgrounds."""
        pose = np.load(folder / "pose.npy", mmap_mode="r")[first:last].astype(float)
        return Views(
            np.load(folder / "views.npy", mmap_mode="r")[first:last].astype(np.float32),
            np.array(np.load(folder / "cover.npy", mmap_mode="r")[first:last]),
            pose[:, :4],
            pose[:, 4],
            np.load(folder / "earths.npy").astype(np.float32),
        )


@dataclass(frozen=True, eq=False)
class Batch:
    """Looks and what the network should say of them.

    Parameters
    ----------
    looks : (B, 64, 64, 2). q_wxyz : (B, 4) against the line of sight.
    box : (B, 3) centre of the craft's sphere from the middle [half sides], logarithm of its size over the right one.
    craft : (B,) 1 where there is one.
    """

    looks: Float32Array
    q_wxyz: FloatArray
    box: FloatArray
    craft: FloatArray


def sample(views: Views, rng: np.random.Generator, size: int) -> Batch:
    """A batch of random looks."""
    looks = np.zeros((size, LOOK_PX, LOOK_PX, 2), np.float32)
    q, box, craft = np.zeros((size, 4)), np.zeros((size, 3)), np.ones(size)
    for i in range(size):
        k = int(rng.integers(len(views.signal)))
        # regions of a first pass are wrong by much, those of a second by little
        spread = rng.choice([(0.16, 0.28), (0.05, 0.1)])
        box[i] = (*rng.normal(0, spread[0], 2), np.clip(rng.normal(0, spread[1]), -0.7, 0.5))
        reduced = REDUCED / views.range_in_radii[k] * rng.uniform(0.7, 1.4)
        if rng.random() < EMPTY_SHARE:
            craft[i] = 0.0
            box[i, :2] = rng.uniform(1.0, 2.2, 2) * rng.choice([-1, 1], 2)
        turn = rng.uniform(0, 2 * np.pi)
        signal, cover = _warped(views.signal[k], views.cover[k], turn, box[i])
        gain = float(np.exp(rng.normal(0, 0.4)))
        signal = _shadowed(signal, rng) * gain
        if craft[i] == 0.0 or rng.random() < EARTH_SHARE:
            earth = _window(views.earths[int(rng.integers(len(views.earths)))], reduced / 4, rng)
            signal = signal + (1 - cover) * earth * gain * rng.uniform(0.6, 1.4)
        noise = rng.uniform(0.002, NOISE)
        # below black and above white there is nothing: noise on black lifts its mean
        mean = 0.5 * (signal + np.sqrt(signal * signal + (0.8 * noise) ** 2))
        fine = noise / reduced
        picture = np.minimum(mean, 1.0) + rng.standard_normal(signal.shape, np.float32) * np.float32(fine)
        looks[i] = contrast(picture.astype(np.float32), fine)
        about = np.array([np.cos(turn / 2), 0, 0, np.sin(turn / 2)])
        q[i] = quat.multiply(about, views.q_wxyz[k])
    return Batch(looks, q, box, craft)


def _warped(
    signal: Float32Array, cover: np.typing.NDArray[np.uint8], turn: float, box: FloatArray
) -> tuple[Float32Array, Float32Array]:
    scale = FILLED * LOOK_PX * np.exp(box[2]) / (VIEW_FILLED * VIEW_PX)
    c, s = scale * np.cos(turn), scale * np.sin(turn)
    middle, to = 0.5 * (VIEW_PX - 1), 0.5 * (LOOK_PX - 1) + 0.5 * LOOK_PX * box[:2]
    M = np.array([[c, -s, to[0] - (c - s) * middle], [s, c, to[1] - (c + s) * middle]])
    blur = 0.5 * float(np.sqrt(max(1 / scale**2 - 0.8, 0.05)))
    out = []
    for picture in (signal, cover.astype(np.float32) / 255):
        soft = cv2.GaussianBlur(picture, (0, 0), blur)
        out.append(
            np.asarray(cv2.warpAffine(soft, M, (LOOK_PX, LOOK_PX), flags=cv2.INTER_LINEAR), np.float32)
        )
    return out[0], out[1]


def _shadowed(signal: Float32Array, rng: np.random.Generator) -> Float32Array:
    """Now and then a straight shadow over a part."""
    if rng.random() > 0.08:
        return signal
    angle, at = rng.uniform(0, 2 * np.pi), rng.uniform(-8, 8)
    y, x = np.mgrid[:LOOK_PX, :LOOK_PX] - 0.5 * (LOOK_PX - 1)
    dark = np.cos(angle) * x + np.sin(angle) * y > at
    return np.where(dark, signal * rng.uniform(0.02, 0.4), signal).astype(np.float32)


def _window(earth: Float32Array, reduced: float, rng: np.random.Generator) -> Float32Array:
    """A random part of a background, ``reduced`` of its pixels per pixel, turned by quarters."""
    h, w = earth.shape
    side = int(np.clip(LOOK_PX * reduced, LOOK_PX, min(h, w)))
    x, y = int(rng.integers(w - side + 1)), int(rng.integers(h - side + 1))
    part = cv2.resize(earth[y : y + side, x : x + side], (LOOK_PX, LOOK_PX), interpolation=cv2.INTER_AREA)
    part = np.rot90(part, int(rng.integers(4)))
    return np.ascontiguousarray(part.T if rng.random() < 0.5 else part)
