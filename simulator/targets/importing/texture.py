"""Textures baked to plain colours: sampled once per face, then gathered into a few materials."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from simulator.arrays import vec3
from simulator.targets.importing.raw import unique_names

if TYPE_CHECKING:
    from simulator.arrays import ByteArray, FloatArray, IntArray
    from simulator.targets.importing.raw import RawModel

MOST_COLOURS = 6
SAME_COLOUR = 0.04
"""Root mean square distance in linear RGB within which faces count as of one colour."""
BARYCENTRIC = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]], float)


def decode_image(data: bytes) -> ByteArray | None:
    """(H, W, 3) sRGB image, or None when it is none that OpenCV reads."""
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    return None if image is None else np.ascontiguousarray(image[..., ::-1])


def linear_from_srgb(value: FloatArray) -> FloatArray:
    """Linear light from sRGB, both 0..1 (IEC 61966-2-1)."""
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def face_colours(image: ByteArray, uv: FloatArray, triangles: IntArray) -> FloatArray:
    """(F, 3) linear colour of each face: the mean of four samples of the texture on it.

    Parameters
    ----------
    uv : (N, 2), origin at the image's top left as in glTF; repeats outside 0..1.
    """
    height, width = image.shape[:2]
    weights = BARYCENTRIC / BARYCENTRIC.sum(axis=1, keepdims=True)
    at = np.einsum("sk,fkc->fsc", weights, np.nan_to_num(uv)[triangles]) % 1.0
    x = np.minimum((at[..., 0] * width).astype(int), width - 1)
    y = np.minimum((at[..., 1] * height).astype(int), height - 1)
    return np.asarray(linear_from_srgb(image[y, x] / 255.0).mean(axis=1))


def bake_colours(model: RawModel) -> None:
    """Give faces that have a colour of their own a material of that colour, a few for each one of the file's."""
    coloured = [p for p in model.parts if p.face_colour is not None]
    if not coloured:
        return
    before = len(model.materials)
    for number in range(before):
        picks = [(p, np.flatnonzero((p.face_material == number) & ~np.isnan(p.face_colour[:, 0])))
                 for p in coloured if p.face_colour is not None]  # fmt: skip
        picks = [(p, f) for p, f in picks if len(f)]
        if not picks:
            continue
        colours = np.concatenate([p.face_colour[f] for p, f in picks if p.face_colour is not None])
        centres, label = group_colours(colours)
        base = model.materials[number]
        first = len(model.materials)
        for k, centre in enumerate(centres):
            rgb = vec3(np.clip(centre, 0.0, 1.0))
            model.materials.append(replace(base, name=f"{base.name}-{k + 1}", base_color=rgb))
        start = 0
        for p, f in picks:
            p.face_material[f] = first + label[start : start + len(f)]
            start += len(f)
        model.notes.append(
            f"material {base.name!r}: its texture became {len(centres)} plain colour{'s' * (len(centres) > 1)}; "
            "detail finer than a face is lost"
        )
    names = unique_names((m.name for m in model.materials), "material")
    model.materials = [replace(m, name=n) for m, n in zip(model.materials, names, strict=True)]


def group_colours(colours: FloatArray) -> tuple[FloatArray, IntArray]:
    """As few colours as stand for all within SAME_COLOUR, at most MOST_COLOURS; seeded, so repeatable."""
    distinct, inverse = np.unique(np.round(colours, 3), axis=0, return_inverse=True)
    if len(distinct) == 1:
        return distinct, inverse.ravel()
    sample = colours if len(colours) <= 20_000 else colours[:: len(colours) // 20_000 + 1]
    centres, label = sample, np.zeros(len(colours), np.int64)
    for k in range(1, MOST_COLOURS + 1):
        centres = _lloyd(sample, _spread(sample, k))
        label = np.argmin(((colours[:, None] - centres) ** 2).sum(axis=2), axis=1)
        if float(np.sqrt(((colours - centres[label]) ** 2).sum(axis=1).mean())) <= SAME_COLOUR:
            break
    used, label = np.unique(label, return_inverse=True)
    return centres[used], label.ravel()


def _lloyd(points: FloatArray, centres: FloatArray) -> FloatArray:
    """The centres moved to the means of the points nearest to them, ten times."""
    for _ in range(10):
        label = np.argmin(((points[:, None] - centres) ** 2).sum(axis=2), axis=1)
        kept = [points[label == k].mean(axis=0) for k in range(len(centres)) if (label == k).any()]
        centres = np.array(kept)
    return centres


def _spread(points: FloatArray, k: int) -> FloatArray:
    """K of the points, each far from those before it: a start that no chance has a part in."""
    chosen = [int(np.argmax(((points - points.mean(axis=0)) ** 2).sum(axis=1)))]
    distance = ((points - points[chosen[0]]) ** 2).sum(axis=1)
    for _ in range(k - 1):
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
    return points[chosen]
