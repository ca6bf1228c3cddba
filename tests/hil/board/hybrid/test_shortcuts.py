"""Shortcuts of the estimator give what the long way gives: nothing is drawn or counted twice, and nothing differs."""

from __future__ import annotations

import gc
from dataclasses import replace

import numpy as np
import pytest
from kernel_oracle.learned import convolve

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.estimation.vectors import length
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.geometry.response import Response
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit, Source, drawn
from flyaround.hil.board.hybrid.image.edge_field import edge_field
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.image_patch import cut_patch, target_box
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.refine.edges import limit_one_step, limit_step
from flyaround.hil.board.hybrid.refine.parallel import (
    Drawings,
    Pruning,
    draw,
    draw_shadows,
    refine_in_parallel,
)
from flyaround.hil.board.hybrid.refine.photometric import explained, photo_draw, photo_step
from flyaround.hil.board.svd.region_of_interest import Region
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.simulator.targets.library import load_target

CAMERA = CameraIntrinsics(240, 160, 375.0, 375.0, 119.5, 79.5)
T_M = np.array([0.05, -0.05, 4.2])
RNG = np.random.default_rng(8)

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.mark.parametrize(("side", "taps", "stride"), [(16, 5, 2), (8, 3, 1), (8, 3, 2)])
def test_a_convolution_is_the_sum_over_its_taps(side: int, taps: int, stride: int) -> None:
    x = RNG.normal(size=(2, side, side, 3)).astype(np.float32)
    kernel = RNG.normal(size=(taps, taps, 3, 4)).astype(np.float32)
    before = (taps - stride) // 2 if stride > 1 else taps // 2
    wide = np.pad(x, ((0, 0), (before, taps), (before, taps), (0, 0)))
    want = np.zeros((2, side // stride, side // stride, 4))
    for i in range(taps):
        for j in range(taps):
            part = wide[:, i : i + side : stride, j : j + side : stride]
            want += part.astype(float) @ kernel[i, j]
    np.testing.assert_allclose(convolve(x, kernel, stride), want, atol=1e-5)


def test_one_step_is_limited_as_one_of_many() -> None:
    for size in np.geomspace(1e-4, 30.0, 40):
        step, t = size * RNG.normal(size=6), np.array([0.1, 0.2, RNG.uniform(-1.0, 20.0)])
        np.testing.assert_array_equal(limit_one_step(step, t, 0.7), limit_step(step[None], t[None], 0.7)[0])
    broken = np.array([0.1, np.nan, 0.0, 0.2, np.inf, 0.1])
    np.testing.assert_array_equal(
        limit_one_step(broken, T_M, 0.7), limit_step(broken[None], T_M[None], 0.7)[0]
    )


def test_one_attitude_is_what_it_is_among_many() -> None:
    q, p = RNG.normal(size=(2, 500, 4))
    q[0], q[1], q[2, 0] = 0.0, [0.0, -1.0, 0.0, 0.0], np.nan
    unit = quat.normalise(q)
    np.testing.assert_array_equal([quat.normalise(one) for one in q], unit)
    np.testing.assert_array_equal(
        [quat.angle_rad(*two) for two in zip(p, unit, strict=True)], quat.angle_rad(p, unit)
    )
    # among them half turns, whose scalar part is no pivot
    unit[3:200, 0] = 0.0
    R = quat.matrix(quat.normalise(unit[1:]))
    np.testing.assert_array_equal([quat.from_matrix(one) for one in R], quat.from_matrix(R))
    assert length(p[0]) == np.linalg.norm(p[0])


def test_what_a_canvas_keeps_of_a_craft_is_not_taken_for_another_ones() -> None:
    """Arguments of kernels are kept with a canvas: other faces, another camera or another canvas have their own."""
    craft = PreparedTarget.prepare(board_model(load_target("tango")), CAMERA)
    frame = Observation(RNG.integers(0, 60, (160, 240)).astype(np.uint8))
    frame.noise = 3.0
    q = quat.normalise(np.array([0.2, 0.3, 0.8, -0.4]))
    box, fit = target_box(craft, q, T_M), PoseFit(q, T_M, 9.9, np.eye(6))
    assert craft.model.faces is not None
    fine, other = craft.model.faces.grouped(6), replace(CAMERA, fx_px=360.0, cx_px=118.0)
    shared = cut_patch(craft, frame, box, 90)

    def stepped(faces: Faces, camera: CameraIntrinsics, canvas: ImagePatch) -> tuple[float, PoseFit | None]:
        drawn = photo_draw(q, T_M, faces, canvas, camera)
        return explained(drawn, canvas), photo_step(fit, drawn, faces, canvas, camera, craft.radius_m, 0.8)

    for faces, camera in (
        (craft.model.faces, CAMERA),
        (fine, CAMERA),
        (fine, other),
        (craft.model.faces, other),
    ):
        (score, there), (own, alone) = (
            stepped(faces, camera, canvas) for canvas in (shared, cut_patch(craft, frame, box, 90))
        )
        assert score == own
        assert there is not None
        assert alone is not None
        np.testing.assert_array_equal([*there.q, *there.t], [*alone.q, *alone.t])
    brighter, alone_so = (
        replace(canvas, clipped=2.0, sigma=5.0) for canvas in (shared, cut_patch(craft, frame, box, 90))
    )
    score, own = (explained(photo_draw(q, T_M, fine, c, CAMERA), c) for c in (brighter, alone_so))
    assert score == own
    assert score != explained(photo_draw(q, T_M, fine, shared, CAMERA), shared)


def test_what_a_canvas_keeps_outlives_the_responses_of_others() -> None:
    craft = PreparedTarget.prepare(board_model(load_target("tango")), CAMERA)
    frame = Observation(RNG.integers(0, 60, (160, 240)).astype(np.uint8))
    frame.noise, faces = 3.0, craft.model.faces
    q = quat.normalise(np.array([0.2, 0.3, 0.8, -0.4]))
    assert faces is not None
    plain = cut_patch(craft, frame, target_box(craft, q, T_M), 90)

    def score(canvas: ImagePatch) -> float:
        return explained(photo_draw(q, T_M, faces, canvas, CAMERA), canvas)

    kept = replace(plain, clipped=4.0)
    before = score(kept)
    # more than are kept anywhere
    for k in range(20):
        score(replace(plain, clipped=1.0 + 0.1 * k))
    gc.collect()
    assert score(kept) == before


@pytest.mark.parametrize("top", [120.0, 254.0])
def test_a_response_without_bright_pixels_is_the_same_as_with_them(top: float) -> None:
    """The end of the scale is looked up only where something comes near it: one bright pixel changes no other."""
    x = np.linspace(-20.0, top, 200, dtype=np.float32)
    mean, slope = Response(6.0, 255.0).of(x)
    beside, own = Response(6.0, 255.0).of(np.append(x, np.float32(300.0)))
    assert slope is not None
    assert own is not None
    np.testing.assert_array_equal(mean, beside[:-1])
    np.testing.assert_array_equal(slope, own[:-1])


def test_what_is_known_is_not_drawn_again_and_ends_where_it_did() -> None:
    craft = PreparedTarget.prepare(board_model(load_target("tango")), CAMERA)
    frame = Observation(RNG.integers(0, 60, (160, 240)).astype(np.uint8))
    frame.noise, frame.background = 3.0, 0.0
    q = quat.normalise(np.array([0.2, 0.3, 0.8, -0.4]))
    box = target_box(craft, q, T_M)
    canvas = cut_patch(craft, frame, box, 72)
    field = edge_field(frame.image, box, 3.0, 100, background=0.0)
    first = Hypothesis(PoseFit(q, T_M), Source(Region(*map(float, box), "learned"), field))
    asked = Hypothesis(PoseFit(q, T_M), Source(Region(*map(float, box), "edges"), field))
    known: Drawings = {}

    def aligned(h: Hypothesis, remember: Drawings | None) -> tuple[Hypothesis, list[Hypothesis]]:
        lit = draw_shadows(craft, canvas, draw(craft, canvas, h, remember), remember)
        prunings = 2 * (Pruning(-9.0, 0.0),)
        return lit, refine_in_parallel(craft, canvas, [lit], (2.0, 1.2), prunings, remember)

    lit, (fresh,) = aligned(first, None)
    aligned(first, known)
    before = len(known)
    again, (recalled,) = aligned(asked, known)
    assert len(known) == before
    assert recalled.start is asked
    assert recalled.source is asked.source
    np.testing.assert_array_equal(recalled.q, fresh.q)
    np.testing.assert_array_equal(recalled.t, fresh.t)
    assert recalled.score == fresh.score
    np.testing.assert_array_equal(drawn(again).picture, drawn(lit).picture)
