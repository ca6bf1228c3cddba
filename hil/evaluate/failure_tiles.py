"""Image tiles of failures: each missed frame with the true and the estimated wireframe."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from flyaround.hil.board.hybrid.debug.overlay import draw_wireframe

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics

# Okabe-Ito colours in BGR.
TRUE_COLOUR, ESTIMATE_COLOUR = (115, 158, 0), (0, 159, 230)

# Size of a tile [px].
WIDTH, HEIGHT = 360, 260

# Half the width of a tile's part of the image relative to the target's box, which leaves a margin of a quarter on each
# side, and its minimum [px], for a target of a few pixels.
BOX_FACTOR, MIN_HALF_PX = 0.75, 60.0

# Percentile of the image that is shown as white, above single hot pixels; blur before a reduction [tile px], against
# aliasing.
WHITE_PERCENTILE, BLUR_PX = 99.8, 0.4

# Grey level outside the image, distinguishable from black space.
OUTSIDE_LEVEL = 70

# Start and end of the arrow to an estimate outside the tile, as shares of the distance from its centre to its edge.
ARROW = (0.72, 0.94)


def failure_tile(
    image: NDArray[Any],
    box_px: tuple[float, float, float, float] | None,
    model: BoardModel,
    camera: CameraIntrinsics,
    true: tuple[Any, Any],
    estimated: tuple[Any, Any] | None,
) -> NDArray[np.uint8]:
    """Return a tile (HEIGHT, WIDTH, 3), BGR, around the target: truth green, estimate orange or an arrow towards it."""
    h, w = image.shape[:2]
    box = box_px or (0.0, 0.0, w - 1.0, h - 1.0)
    half = max(BOX_FACTOR * (box[2] - box[0]), BOX_FACTOR * (box[3] - box[1]) * WIDTH / HEIGHT, MIN_HALF_PX)
    u, v = 0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])
    scale = WIDTH / (2 * half)
    corner = (u - half, v - half * HEIGHT / WIDTH)
    M = np.array(
        [[scale, 0, 0.5 * scale - 0.5 - scale * corner[0]], [0, scale, 0.5 * scale - 0.5 - scale * corner[1]]]
    )
    top = 255.0 / max(float(np.percentile(image, WHITE_PERCENTILE)), 1.0)
    flat = np.clip(image.astype(np.float32) * top, 0, 255).astype(np.uint8)
    flags = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    if scale < 1:
        flat = cv2.GaussianBlur(flat, (0, 0), BLUR_PX / scale)
    cut = cv2.warpAffine(flat, M, (WIDTH, HEIGHT), flags=flags, borderValue=OUTSIDE_LEVEL)
    tile = np.asarray(cv2.cvtColor(cut, cv2.COLOR_GRAY2BGR), np.uint8)
    draw_wireframe(tile, model, camera, *true, TRUE_COLOUR, corner, scale)
    if estimated is not None:
        draw_wireframe(tile, model, camera, *estimated, ESTIMATE_COLOUR, corner, scale)
        _draw_arrow(tile, camera, estimated[1], corner, scale)
    return tile


def _draw_arrow(
    tile: NDArray[np.uint8],
    camera: CameraIntrinsics,
    t: Any,  # noqa: ANN401 - array-like
    corner: tuple[float, float],
    scale: float,
) -> None:
    """Draw an arrow towards an estimate whose centre is outside the tile."""
    if t[2] <= 0:
        return
    middle = np.array([WIDTH, HEIGHT]) / 2
    p = (camera.pixels(np.asarray(t, float)[None])[0] - corner) * scale - middle
    reach = float(np.max(np.abs(p) / middle))
    if reach > 1.0:
        a, b = (tuple(int(x) for x in middle + k * p / reach) for k in ARROW)
        cv2.arrowedLine(tile, a, b, ESTIMATE_COLOUR, 2, cv2.LINE_AA, 0, 0.4)
