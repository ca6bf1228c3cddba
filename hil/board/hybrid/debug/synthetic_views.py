"""Debug pictures of the network's proposal and of the synthetic view of the pose."""

from __future__ import annotations

from typing import List, Optional, Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.debug.overlay import ORANGE, draw_wireframe, fitted, grey, label
from flyaround.hil.board.hybrid.propose.keypoints.image_crop import crop_image, network_inputs
from flyaround.hil.board.hybrid.propose.keypoints.keypoint_proposal import LearnedProposal
from flyaround.hil.board.hybrid.propose.keypoints.network_input import INPUT_FILL
from flyaround.hil.board.hybrid.refine.synthetic_view import SyntheticViews

Array = np.ndarray


# Range of the residual pictures [standard deviations of the noise].
MAX_RESIDUAL_SIGMA = 8.0


def learned_proposal_picture(
    image: Array,
    proposal: LearnedProposal,
    noise: float,
    model: BoardModel,
    camera: CameraIntrinsics,
    size: Tuple[int, int],
) -> Array:
    """Return a picture (H, W, 3) of the network's input at one place, and the five most likely attitudes.

    Parameters
    ----------
    image : (H, W) array
        Image.
    proposal : LearnedProposal
        The network's proposal at one place.
    noise : float
        Standard deviation of the image noise.
    model : BoardModel
        Model of the target.
    camera : CameraIntrinsics
        Intrinsics of the camera.
    size : tuple of int
        Width and height of the picture [px].
    """
    side = min(size[0] // 3, size[1] // 2)
    input_image = network_inputs(image, noise, camera, [proposal.crop])[0, 0]
    low, high = np.percentile(input_image, [1, 99.5])
    first = cv2.resize(input_image, (side, side), interpolation=cv2.INTER_NEAREST)
    tiles = [grey(first - low, float(high - low))]
    label(tiles[0], "shown to the network")
    view = crop_image(image, camera, proposal.crop, side, INPUT_FILL * side)
    f = 0.5 * (camera.fx_px + camera.fy_px) * INPUT_FILL * side / proposal.crop.diameter_px
    small = CameraIntrinsics(side, side, f, f, 0.5 * (side - 1), 0.5 * (side - 1))
    crop_from_camera = quat.from_matrix(proposal.crop.swing().T)
    for k in range(min(5, len(proposal.q))):
        tile = grey(view, max(float(np.percentile(view, 99.5)), 1.0))
        q = quat.normalise(quat.multiply(crop_from_camera, proposal.q[k]))
        draw_wireframe(tile, model, small, q, proposal.crop.swing().T @ proposal.t[k], ORANGE)
        label(tile, f"{k + 1}: log likelihood {proposal.log_likelihood[k] - proposal.log_likelihood[0]:.1f}")
        tiles.append(tile)
    return _grid(tiles, 3, size)


def synthetic_view_picture(views: SyntheticViews, size: Tuple[int, int]) -> Array:
    """Return a picture (H, W, 3) of the image, the synthetic views with and without shadows, and their residuals."""
    top = max(float(np.percentile(views.picture, 99.8)), 1.0)
    best = views.plain if views.shadowed is None else views.shadowed
    panels = [
        (grey(views.picture, top), "the picture"),
        (grey(views.plain, top), "rendered, no shadows"),
        (_residual_colours(views.picture - views.plain, views.noise), "residual, no shadows"),
    ]
    if views.shadowed is not None:
        panels.insert(2, (grey(best, top), "rendered, with shadows"))
        panels.append((_residual_colours(views.picture - best, views.noise), "residual, with shadows"))
        panels.insert(3, (_compass(views.sun, panels[0][0].shape), "the Sun, seen from the camera"))
    tiles = []
    for picture, text in panels:
        tiles.append(fitted(picture, text, size[0] // 3, size[1] // 2))
    return _grid(tiles, 3, size)


def _residual_colours(residual: Array, noise: float) -> Array:
    """Return residuals in colour: red where the image is brighter than the view, blue where it is darker."""
    r = np.clip(residual / max(MAX_RESIDUAL_SIGMA * noise, 1e-9), -1, 1)
    white = np.full((*r.shape, 3), 255.0)
    white[..., 0] -= 255 * np.clip(r, 0, 1)
    white[..., 1] -= 255 * np.abs(r)
    white[..., 2] -= 255 * np.clip(-r, 0, 1)
    return np.asarray(white, np.uint8)


def _compass(sun: Optional[Array], shape: Tuple[int, ...]) -> Array:
    """Return a picture of a sphere lit from the direction of the Sun."""
    h, w = shape[:2]
    r = 0.35 * min(h, w)
    x, y = np.meshgrid((np.arange(w) - 0.5 * (w - 1)) / r, (np.arange(h) - 0.5 * (h - 1)) / r)
    inside = x * x + y * y < 1
    z = -np.sqrt(np.maximum(1 - x * x - y * y, 0))
    s = np.zeros(3) if sun is None else sun
    return grey(np.where(inside, 0.12 + 0.88 * np.clip(x * s[0] + y * s[1] + z * s[2], 0, 1), 0), 1.0)


def _grid(tiles: List[Array], columns: int, size: Tuple[int, int]) -> Array:
    canvas = np.zeros((size[1], size[0], 3), np.uint8)
    for k, tile in enumerate(tiles):
        h, w = tile.shape[:2]
        y, x = (k // columns) * (size[1] // 2), (k % columns) * (size[0] // columns)
        canvas[y : y + h, x : x + w] = tile
    return canvas
