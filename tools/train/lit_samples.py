"""Training samples of a learned proposal under any light: what `lit_views` drew, mixed, burnt out, veiled and framed.

Two kinds of sample. *Orbit*: the Sun and a little of all others, exposed and made noisy as `proposal_samples` does.
*Laboratory*: several lights of random strength; every surface brighter or darker than its paint by chance, some of
them mirrors of a lamp; a fall-off across the craft; other textures on it (as of Park & D'Amico 2024, Robust multi-task
learning and online refinement for spacecraft pose estimation across domain gap), bars and cables that the model has
not, a shape a little bent; burnt out by up to a half of it; a glow round what is bright, light that strays across the
picture, a black level; specks, textures behind, parts hidden, blur and another tone curve.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.propose.learned.network import INPUT_FILL, INPUT_PX, contrast
from tools.train.lit_views import SUNS
from tools.train.proposal_samples import (
    ASTRAY,
    ASTRAY_SHARE,
    EARTH_SHARE,
    EMPTY_SHARE,
    EXPOSED,
    MISMEASURED,
    NOISE,
    OFF,
    REDUCED,
    SHOWN,
    SIZES,
    Batch,
    framed,
    shadowed,
    window,
)
from tools.train.proposal_views import FILLED as VIEW_FILLED
from tools.train.proposal_views import VIEW_PX

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.random import Generator
    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray

# Share of samples in orbit, and of those of the laboratory with a texture behind.
ORBIT_SHARE, LAB_EARTH_SHARE = 0.25, 0.4

# Shares of those of the laboratory with another texture on the craft, with bars and cables, bent, with stray light.
TEXTURED, CABLED, BENT, STRAY = 0.3, 0.3, 0.3, 0.25

# By how much a sample is bent, standard deviation, and over what length [px].
BENT_PX, BENT_OVER_PX = 0.6, 10.0

# Brightest signal that is kept [full scale].
MOST = 12.0

_Y, _X = (np.mgrid[:VIEW_PX, :VIEW_PX] / (0.5 * VIEW_PX) - 1.0).astype(np.float32)

_V, _U = (np.mgrid[:INPUT_PX, :INPUT_PX] / (0.5 * INPUT_PX) - 1.0).astype(np.float32)


@dataclass(frozen=True, eq=False)
class LitViews:
    """What `lit_views` wrote, and backgrounds of `proposal_views`.

    Parameters
    ----------
    lit : (N, L, 72, 72) square roots of signals, of 255. scale : (N, L) brightest signal of each.
    label : (N, 72, 72) number of the surface. earths : backgrounds, then the same at halves of the size.
    """

    lit: NDArray[np.uint8]
    scale: Float32Array
    cover: NDArray[np.uint8]
    label: NDArray[np.uint8]
    q_wxyz: FloatArray
    range_in_radii: FloatArray
    earths: tuple[Float32Array, ...]

    @staticmethod
    def read(folder: Path, first: int, last: int) -> LitViews:
        """Views ``first`` to ``last`` of a folder, all of its backgrounds."""

        def part(name: str) -> NDArray[Any]:
            return np.array(np.load(folder / f"{name}.npy", mmap_mode="r")[first:last])

        earths = [np.load(folder / "earths.npy").astype(np.float32)]
        for _ in range(2):
            n, h, w = earths[-1].shape
            earths.append(earths[-1].reshape(n, h // 2, 2, w // 2, 2).mean(axis=(2, 4)))
        pose = part("pose").astype(float)
        return LitViews(
            part("lit"),
            part("scale"),
            part("cover"),
            part("label"),
            pose[:, :4],
            pose[:, 4],
            tuple(earths),
        )


def sample_lit(views: LitViews, rng: Generator, size: int) -> Batch:
    """A batch of random inputs."""
    which = rng.integers(len(views.lit), size=size)
    off = np.array(OFF)[rng.choice(len(OFF), size, p=SHOWN)]
    box = rng.normal(0, 1, (size, 3)) * off[:, [0, 0, 1]]
    box[:, 2] = np.clip(box[:, 2], *SIZES)
    craft = (rng.random(size) >= EMPTY_SHARE).astype(float)
    empty = np.flatnonzero(craft == 0)
    box[empty, :2] = rng.uniform(1.0, 2.2, (len(empty), 2)) * rng.choice([-1, 1], (len(empty), 2))
    reduced = REDUCED / views.range_in_radii[which] * np.exp(-box[:, 2]) * rng.uniform(0.7, 1.4, size)
    turn = rng.uniform(0, 2 * np.pi, size)
    orbit = rng.random(size) < ORBIT_SHARE
    noise = rng.uniform(*NOISE, size)
    fine = (noise / np.maximum(reduced, 1.0)).astype(np.float32)
    pictures = np.empty((size, INPUT_PX, INPUT_PX), np.float32)
    for i in range(size):
        k = which[i]
        signal = _in_orbit(views, k, rng) if orbit[i] else _in_laboratory(views, k, rng)
        picture, cover = _warped(signal, views.cover[k], turn[i], box[i])
        if orbit[i]:
            picture = _orbit_picture(picture, cover, views, reduced[i], craft[i], noise[i], rng)
        else:
            picture = _laboratory_picture(picture, cover, views, reduced[i], craft[i], rng)
        picture += rng.standard_normal(picture.shape, np.float32) * fine[i]
        pictures[i] = framed(picture, reduced[i], box[i], rng)
    inputs = contrast(pictures, fine * np.exp(rng.uniform(*MISMEASURED, size)).astype(np.float32))
    about = np.stack([np.cos(turn / 2), 0 * turn, 0 * turn, np.sin(turn / 2)], axis=-1)
    return Batch(inputs, quat.multiply(about, views.q_wxyz[which]), box, craft)


def _mixed(views: LitViews, k: int, weights: FloatArray) -> Float32Array:
    """(72, 72) signal of the craft in a mixture of its lights."""
    used = np.flatnonzero(weights)
    root = views.lit[k, used].astype(np.float32)
    gain = (weights[used] * views.scale[k, used]).astype(np.float32) / np.float32(255.0**2)
    return np.einsum("j,jyx->yx", gain, root * root)


def _in_orbit(views: LitViews, k: int, rng: Generator) -> Float32Array:
    """The craft in the light of the Sun, and a little of what the Earth gives back."""
    lights = views.lit.shape[1]
    weights = np.full(lights, rng.uniform(0.0, 0.02))
    weights[rng.integers(min(lights, SUNS))] = 1.0
    return _mixed(views, k, weights)


def _in_laboratory(views: LitViews, k: int, rng: Generator) -> Float32Array:
    """The craft by several lamps, its surfaces other than in the model; its share burnt out is set by chance."""
    lights = views.lit.shape[1]
    weights = np.exp(rng.normal(0, 1.5, lights)) * (rng.random(lights) < rng.choice([0.3, 0.6, 1.0]))
    if not weights.any():
        weights[rng.integers(lights)] = 1.0
    signal = _mixed(views, k, weights)
    # another paint, and mirrors of a lamp; each surface with a fall-off of its own
    spread, tilt = rng.uniform(0.05, 0.7), rng.uniform(0.0, 1.2)
    log_gain = rng.normal(0, spread, 256)
    mirror = rng.random(256) < 0.06
    log_gain[mirror] += rng.uniform(0.5, 3.0, int(mirror.sum()))
    a, b = (rng.normal(0, tilt, 256).astype(np.float32) + np.float32(rng.normal(0, 0.5)) for _ in range(2))
    label = views.label[k]
    field = log_gain.astype(np.float32)[label] + a[label] * _X + b[label] * _Y
    # a floor of light: what is in shadow is not quite black, with all surfaces alike
    floor = np.float32(rng.choice([0.0, 0.01, 0.04]) * float(signal.max()))
    signal = (signal + floor * (label > 0)) * np.exp(np.clip(field, -3, 3))
    seen = signal[views.cover[k] > 128]
    if not len(seen):
        return signal
    # a quantile of what is seen gets a level: from little light to half of the craft burnt out
    level = float(np.exp(rng.normal(np.log(0.7), 0.7)))
    return signal * np.float32(level / max(float(np.quantile(seen, rng.uniform(0.5, 0.995))), 1e-4))


def _orbit_picture(
    signal: Float32Array,
    cover: Float32Array,
    views: LitViews,
    reduced: float,
    craft: float,
    noise: float,
    rng: Generator,
) -> Float32Array:
    astray = rng.random() < ASTRAY_SHARE
    gain = np.float32(np.exp(rng.uniform(-ASTRAY, ASTRAY) if astray else rng.normal(0, EXPOSED)))
    picture = shadowed(signal, rng) * gain
    if craft == 0.0 or rng.random() < EARTH_SHARE:
        earth = window(views.earths, reduced / 4, rng)
        picture = picture + (1 - cover) * earth * np.float32(gain * rng.uniform(0.6, 1.4))
    # below black and above white there is nothing: noise on black lifts its mean
    lifted = np.float32(0.8 * noise)
    return np.minimum(0.5 * (picture + np.sqrt(picture * picture + lifted * lifted)), 1.0)


def _laboratory_picture(
    signal: Float32Array,
    cover: Float32Array,
    views: LitViews,
    reduced: float,
    craft: float,
    rng: Generator,
) -> Float32Array:
    picture = np.minimum(shadowed(signal, rng), MOST)
    if rng.random() < TEXTURED:
        texture = window(views.earths, reduced / 4 * rng.uniform(0.25, 1.0), rng)
        texture = (texture - texture.mean()) / max(float(texture.std()), 1e-3)
        strength = np.float32(rng.uniform(0.1, 0.7))
        picture = picture * np.exp(strength * np.clip(texture, -2.5, 2.5) * cover)
    if rng.random() < CABLED:
        _cabled(picture, rng)
    if craft == 0.0 or rng.random() < LAB_EARTH_SHARE:
        behind = window(views.earths, reduced / 4 * rng.uniform(0.5, 2.0), rng)
        behind = behind ** np.float32(rng.uniform(0.6, 1.6)) * np.float32(np.exp(rng.uniform(-2.5, 0.8)))
        picture = picture + (1 - cover) * behind
    for _ in range(rng.integers(4) if rng.random() < 0.4 else 0):
        at = rng.integers(INPUT_PX, size=2).tolist()
        cv2.circle(picture, at, 0, float(rng.uniform(0.1, 0.8)), -1)
    if rng.random() < 0.15:
        # something in front, as bright as anything
        x, y = rng.integers(INPUT_PX, size=2)
        w, h = rng.integers(4, 24, size=2)
        picture[y : y + h, x : x + w] = rng.choice([0.0, rng.uniform(0, 1.2)])
    if rng.random() < BENT:
        picture = _bent(picture, rng)
    if rng.random() < 0.6:
        glow = cv2.GaussianBlur(picture, (0, 0), float(rng.uniform(1.5, 9.0)))
        picture = picture + np.float32(rng.uniform(0.0, 0.12)) * glow
    if rng.random() < 0.5:
        picture = cv2.GaussianBlur(picture, (0, 0), float(rng.uniform(0.3, 1.0)))
    picture = np.clip(picture, 0.0, 1.0) ** np.float32(np.exp(rng.normal(0, 0.2)))
    if rng.random() < STRAY:
        a = rng.uniform(0, 2 * np.pi)
        ramp = np.clip(0.5 + 0.5 * (np.cos(a) * _U + np.sin(a) * _V), 0, 1) ** np.float32(
            rng.uniform(0.5, 4.0)
        )
        picture = picture + np.float32(rng.uniform(0.0, 0.2)) * ramp
    # a black level that was taken away but for a rest
    return np.minimum(picture + np.float32(max(rng.normal(0, 0.03), 0.0)), 1.0)


def _cabled(picture: Float32Array, rng: Generator) -> None:
    """Draws bars and cables across the picture."""
    top = max(float(np.quantile(picture, 0.99)), 1e-3)
    for _ in range(int(rng.integers(1, 5))):
        middle = 0.5 * INPUT_PX + rng.normal(0, 0.2 * INPUT_PX, 2)
        half = rng.normal(0, 0.12 * INPUT_PX, 2)
        a, b = np.rint(middle - half).astype(int).tolist(), np.rint(middle + half).astype(int).tolist()
        cv2.line(picture, a, b, top * float(rng.choice([0.0, rng.uniform(0, 1)])), 1, cv2.LINE_AA)


def _bent(picture: Float32Array, rng: Generator) -> Float32Array:
    """The picture with its places moved a little, those beside each other alike."""
    off = rng.standard_normal((2, INPUT_PX, INPUT_PX), np.float32)
    moved = []
    for o, at in zip(off, np.mgrid[:INPUT_PX, :INPUT_PX][::-1], strict=True):
        smooth = cv2.GaussianBlur(o, (0, 0), BENT_OVER_PX)
        moved.append((at + smooth * (BENT_PX / max(float(smooth.std()), 1e-6))).astype(np.float32))
    x, y = moved
    return np.asarray(cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def _warped(
    signal: Float32Array, cover: NDArray[np.uint8], turn: float, box: FloatArray
) -> tuple[Float32Array, Float32Array]:
    scale = INPUT_FILL * INPUT_PX * np.exp(box[2]) / (VIEW_FILLED * VIEW_PX)
    c, s = scale * np.cos(turn), scale * np.sin(turn)
    middle, to = 0.5 * (VIEW_PX - 1), 0.5 * (INPUT_PX - 1) + 0.5 * INPUT_PX * box[:2]
    M = np.array([[c, -s, to[0] - (c - s) * middle], [s, c, to[1] - (c + s) * middle]])
    both = np.dstack([np.minimum(signal, np.float32(MOST)), cover.astype(np.float32) / np.float32(255)])
    blur = 0.5 * float(np.sqrt(max(1 / scale**2 - 0.8, 0.05)))
    soft = cv2.GaussianBlur(both, (0, 0), blur)
    out = cv2.warpAffine(soft, M, (INPUT_PX, INPUT_PX), flags=cv2.INTER_LINEAR)
    return np.ascontiguousarray(out[..., 0]), np.ascontiguousarray(out[..., 1])
