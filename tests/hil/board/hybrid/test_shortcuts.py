"""Shortcuts of the estimator give what the long way gives: nothing is drawn or counted twice, and nothing differs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.hypotheses.hypothesis import PoseFit
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.image_patch import cut_patch, target_box
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.refine.photometric import explained, photo_draw, photo_step
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.simulator.targets.library import load_target

CAMERA = CameraIntrinsics(240, 160, 375.0, 375.0, 119.5, 79.5)
T_M = np.array([0.05, -0.05, 4.2])
RNG = np.random.default_rng(8)

pytestmark = pytest.mark.usefixtures("one_thread")


def test_what_a_canvas_keeps_of_a_craft_is_not_taken_for_another_ones() -> None:
    """Arguments of kernels are kept with a canvas: other faces, another camera or another canvas have their own."""
    craft = PreparedTarget.prepare(board_model(load_target("tango")), CAMERA)
    frame = Observation(RNG.integers(0, 60, (160, 240)).astype(np.uint8))
    frame.noise = 3.0
    q = quat.normalise(np.array([0.2, 0.3, 0.8, -0.4]))
    box, fit = target_box(craft, q, T_M), PoseFit(q, T_M)
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
