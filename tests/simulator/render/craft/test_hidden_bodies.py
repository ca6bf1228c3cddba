"""Sun and Moon behind the target, with outlines that differ by more than a pixel."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from flyaround.simulator.camera.lens.distortion import Distortion
from flyaround.simulator.dataset.check.geometry import OUTLINE_TOLERANCE_PX, differing_pixels
from flyaround.simulator.frame import take_frame
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.world.frames.rotation import matrix_from_quat

pytestmark = pytest.mark.gl

BEHIND = (0.004, -0.003, 1.0)
"""Where Sun or Moon stand, camera frame: some pixels from the middle."""
MOON_M = 3.844e8


@pytest.fixture(params=["sun", "moon"])
def behind(request, draw_kit):
    """A scene of a black plate from a given column on, before the Sun or a full Moon: its light, by column."""

    def scene_of(target):
        lit = draw_kit.scene(
            target,
            sun_camera=BEHIND if request.param == "sun" else (0.0, 0.3, -1.0),
            environment=msgspec.structs.replace(draw_kit.nothing, **{request.param: True}),
            sun_visible_fraction=0.0,
        )
        if request.param == "moon":
            to_eci = matrix_from_quat(lit.q_camera_from_eci_wxyz).T
            way = to_eci @ (np.array(BEHIND) / np.linalg.norm(BEHIND))
            lit = lit.with_body("moon", r_eci_m=vec3(np.array(lit.r_camera_eci_m) + MOON_M * way))
        return lit

    return scene_of


def test_plate_hides_only_what_is_behind_it(renderer, draw_kit, behind):
    black = draw_kit.white(base_color=(0.0, 0.0, 0.0))

    def light(edge_px):
        """Light of the picture with a plate from a column on, 5 m ahead."""
        x = (edge_px - draw_kit.camera.cx_px) / draw_kit.camera.fx_px * 5.0
        target = draw_kit.target([draw_kit.plate("p", "white", (x + 2.0, 0.0, 0.0), 2.0)], [black])
        return renderer.render(behind(target), target).radiance.astype(float)

    whole, column = light(315.0), draw_kit.camera.cx_px + BEHIND[0] * draw_kit.camera.fx_px
    assert whole.sum() > 0
    assert (whole * np.arange(whole.shape[1])).sum() / whole.sum() == pytest.approx(column, abs=0.3)
    none = light(column - 8.0)
    assert none[:, round(column) - 4 :].sum() == 0.0
    half = light(column)
    # the disc is six pixels wide: a third of a pixel that the edge may be off is a tenth of it
    assert half.sum() / whole.sum() == pytest.approx(0.5, abs=0.1)
    free = slice(None, int(column) - 1)
    assert half[:, free] == pytest.approx(whole[:, free], rel=1e-6)
    # of the columns that the edge runs through each keeps its share
    assert np.all(half <= whole * (1 + 1e-6))


@pytest.mark.parametrize(("dx", "dy"), [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_an_outline_may_be_off_by_a_pixel_and_no_more_to_any_side(renderer, draw_kit, dx, dy):
    camera = draw_kit.camera
    # its edges are nearly those of pixels: what is surely inside and what is touched are nearly one
    x0, x1 = ((x - camera.cx_px) / camera.fx_px * 5.0 for x in (100.48, 220.52))
    y0, y1 = ((y - camera.cy_px) / camera.fy_px * 5.0 for y in (50.48, 180.52))
    plate = draw_kit.quad("p", "white", [(x0, y0, 0.0), (x0, y1, 0.0), (x1, y1, 0.0), (x1, y0, 0.0)])
    target = draw_kit.target([plate], [draw_kit.white()])
    frame = take_frame(renderer, draw_kit.scene(target), target)

    def doubts(by):
        return len(differing_pixels(frame.truth, np.roll(frame.mask, (dy * by, dx * by), (0, 1)), target))

    assert doubts(OUTLINE_TOLERANCE_PX) == 0
    assert doubts(OUTLINE_TOLERANCE_PX + 1) > 100


def test_straight_edges_of_large_triangles_are_bent_by_the_lens(renderer, draw_kit):
    """A plate of two triangles over most of the image: between their corners its edges are pixels off the chords."""
    lens = Distortion("brown_conrady", (-0.5, 0.2, 0.0, 0.0))
    camera = replace(draw_kit.camera, fx_px=250.0, fy_px=250.0, distortion=lens)
    target = draw_kit.target([draw_kit.plate("p", "white", (0.0, 0.0, 0.0), 1.9)], [draw_kit.white()])
    frame = take_frame(renderer, draw_kit.scene(target, camera=camera), target)
    assert 0.3 < np.mean(frame.mask > 0) < 0.95
    assert len(differing_pixels(frame.truth, frame.mask, target)) == 0
