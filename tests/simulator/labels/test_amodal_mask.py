"""The amodal mask of a craft that the image's edge cuts, against a camera whose image holds all of it."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.labels.layers import amodal_mask, visible_mask
from flyaround.simulator.labels.surfaces import surfaces

pytestmark = pytest.mark.gl
MARGIN_PX = 120


@pytest.mark.parametrize(
    "t_m",
    [
        (0.0, 0.7, 4.0),
        (0.0, -0.75, 4.0),
        (1.0, 0.0, 4.0),
        (-1.1, 0.0, 4.0),
        (0.9, 0.8, 4.0),
        (-1.0, -0.7, 4.0),
    ],
    ids=["bottom", "top", "right", "left", "lower right", "upper left"],
)
def test_every_row_and_column_beyond_the_edge_is_there(renderer, draw_kit, t_m):
    """Down to the last one, which is a corner of the craft and some pixels long."""
    camera = replace(draw_kit.camera, fy_px=520.0)
    craft = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.35)], [draw_kit.white()])
    scene = draw_kit.scene(craft, camera=camera, t_m=t_m, rotvec_rad=(0.0, 0.0, 0.4))
    wide = replace(
        camera,
        width_px=camera.width_px + 2 * MARGIN_PX,
        height_px=camera.height_px + 2 * MARGIN_PX,
        cx_px=camera.cx_px + MARGIN_PX,
        cy_px=camera.cy_px + MARGIN_PX,
    )
    mask, whole = (
        visible_mask(surfaces(renderer, replace(scene, camera=one), craft, layers=False))
        for one in (camera, wide)
    )
    corners = camera.project(scene.camera_from_target.apply(craft.parts[0].positions_m.astype(float)))
    box = (*corners.min(axis=0), *corners.max(axis=0))
    found = amodal_mask(renderer, scene, craft, mask, box)
    x, y = np.array(found.origin_px) + MARGIN_PX
    height, width = found.mask.shape
    placed = np.zeros_like(whole)
    placed[y : y + height, x : x + width] = found.mask
    for axis in (0, 1):
        ours, theirs = (np.flatnonzero(image.any(axis=axis)) for image in (placed, whole))
        assert (ours[0], ours[-1]) == (theirs[0], theirs[-1])
    # another raster may round a pixel's centre on an edge the other way
    assert np.count_nonzero(placed != whole) < 0.002 * np.count_nonzero(whole)
    assert np.count_nonzero(found.mask) > np.count_nonzero(mask) > 0
