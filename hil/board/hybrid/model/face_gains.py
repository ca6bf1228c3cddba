"""Brightness of the target's faces, fitted to the image, and the synthetic view rendered with it."""

from __future__ import annotations

from typing import Optional, Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.geometry.shading import Shading
from flyaround.hil.board.hybrid.model.image_formation import blurred, gaussian, response_tables
from flyaround.hil.board.hybrid.native.interface import contiguous
from flyaround.hil.board.hybrid.native.library import library

Array = np.ndarray

# Standard deviation of the optical blur [image px], and of the blur that gives the local background [patch px].
OPTICS_PX, LOCAL_PX = 1.0, 8.0

# Number of the largest groups that are checked for saturation.
MAX_SATURATED_GROUPS = 4

# Least share of a face, and of its surroundings, in a pixel of the border that shows the blur, and least number of such
# pixels; hand-tuned.
MIN_BORDER_SHARE, MIN_BORDER_PIXELS = 0.02, 10

# Candidates for a saturated face's brightness above full scale [full scales].
EXCESS_CANDIDATES = np.array([0.0, 0.15, 0.35, 0.6, 1.0, 1.6, 2.4, 3.5])


def shade(faces: Faces, visible_face: Array, patch: ImagePatch, dark: Optional[Array] = None) -> Shading:
    """Fit the brightness of each face group to the image, and return the synthetic view rendered with it.

    Parameters
    ----------
    faces : Faces
        Faces of the target.
    visible_face : (H, W) array
        Visible faces, from ``draw_faces``.
    patch : ImagePatch
        Reduced region of the image around the target.
    dark : (H, W) array, optional
        True for rendered pixels in the shadow of another face.
    """
    h, w = patch.gray.shape
    group, level, picture, centre, area, core, empty, ground = _shade_groups(faces, visible_face, patch, dark)
    bright = (area >= 60) & (level > 0.97 * patch.full_scale)
    # saturated faces are rare
    for k in 1 + np.argsort(-area[1:], kind="stable")[:MAX_SATURATED_GROUPS] if bright[1:].any() else ():
        if bright[k]:
            part = cv2.resize((group == k).astype(np.float32), (w, h), interpolation=cv2.INTER_AREA)
            excess = _saturated_excess(picture, part, patch)
            level[k] += excess
            picture = picture + np.float32(excess) * part
    background_offset = None
    if patch.textured:
        view_data = group, level, picture, centre, core, empty, ground
        background_offset, picture = _with_background(patch, view_data, LOCAL_PX / 4)
    return Shading(visible_face, group, level, picture, centre, area, background_offset)


def _with_background(patch: ImagePatch, view_data: Tuple[Array, ...], blur_px: float) -> Tuple[Array, Array]:
    """Return the background minus its level (h, w), and the synthetic view with it added.

    Parameters
    ----------
    patch : ImagePatch
        Reduced region of the image around the target.
    view_data : tuple of array
        Groups, levels, view, groups at pixel centres, pixels well inside a group, the background's share of each pixel,
        and the background's mean.
    blur_px : float
        Standard deviation of the blur, in units of 4 x 4 pixels.
    """
    _, level, picture, centre, core, empty, background_level = view_data
    h, w = patch.gray.shape
    if min(h, w) < 2:
        # a single row has no surroundings
        return np.zeros((h, w), np.float32), picture
    gray, out = contiguous(patch.gray, "float32"), np.empty((h, w), np.float32)
    curve, blur, picture = response_tables(patch.response), gaussian(blur_px), contiguous(picture, "float32")
    ground = float(background_level[0]), float(level[0])
    if library().fly_background(gray, core, centre, h, w, *ground, curve, blur, empty, out, picture) < 0:
        raise MemoryError("out of memory while computing the background")
    return out, picture


def _shade_groups(
    faces: Faces, visible_face: Array, patch: ImagePatch, dark: Optional[Array]
) -> Tuple[Array, ...]:
    """Return the groups of the rendered pixels, their levels, and the synthetic view.

    Returns
    -------
    tuple of array
        Groups (H, W), their levels (n,), the view (h, w), groups at pixel centres (h, w), areas (n,), pixels well
        inside a group (h, w), the background's share of each pixel (h, w) or an empty array if the background is
        uniform, and the background's mean (1,).
    """
    (h, w), f, count = patch.gray.shape, patch.fine, len(faces.corners)
    shape = h * f, w * f
    group, centre, core = np.empty(shape, np.uint8), np.empty((h, w), np.uint8), np.empty((h, w), bool)
    picture = np.empty((h, w), np.float32)
    share = np.empty((h, w) if patch.textured else (0, 0), np.float32)
    level, area, ground = np.empty(256), np.empty(256, np.int64), np.empty(1)
    n = library().fly_face_gains(
        contiguous(visible_face, "int32", shape),
        None if dark is None else contiguous(dark, "bool", shape),
        contiguous(faces.labels, "uint16", (count + 1,)),
        count,
        faces.groups + 1,
        contiguous(patch.gray, "float32"),
        h,
        w,
        f,
        patch.sigma,
        response_tables(patch.response),
        group,
        centre,
        core,
        picture,
        level,
        area,
        ground,
        share if patch.textured else None,
    )
    if n < 0:
        raise MemoryError("out of memory while fitting the brightness of faces")
    if n == 0:
        # a byte does not number the groups in view
        return _shade_groups(faces.coarser, visible_face, patch, dark)
    return group, level[:n], picture, centre, area[:n], core, share, ground


def _saturated_excess(picture: Array, part: Array, patch: ImagePatch) -> float:
    """Return a saturated face's excess over full scale, estimated from the blur that it spreads over its border."""
    optics = OPTICS_PX / patch.factor
    base, part_share = blurred(picture, optics), blurred(part, optics)
    ring = (part_share > MIN_BORDER_SHARE) & (part_share < 1 - MIN_BORDER_SHARE)
    if int(ring.sum()) < MIN_BORDER_PIXELS:
        return 0.0
    base, part_share, gray = base[ring], part_share[ring], patch.gray[ring]
    excess = EXCESS_CANDIDATES * patch.full_scale
    drawn = patch.response.mean(base + excess[:, None].astype(np.float32) * part_share)
    return float(excess[int(np.abs(drawn - gray).sum(axis=1).argmin())])
