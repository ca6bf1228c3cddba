"""A craft of which little is lit: its pose is found about what is seen, though the proposal takes that for all."""

from __future__ import annotations

import numpy as np
import pytest

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.estimator import PoseEstimator
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.image.edge_field import shrink
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.many_groups import blurred
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.model.rasteriser import draw_faces, order_faces
from flyaround.hil.board.hybrid.model.shadow_map import ShadowMap
from flyaround.hil.board.hybrid.propose.learned_hypotheses import (
    hypotheses_of_places,
    learned_hypotheses,
)
from flyaround.hil.board.hybrid.propose.regions import propose_regions
from flyaround.hil.board.hybrid.refine.coarse import refine_many_scales
from flyaround.hil.board.svd.weak_gradients import eliminate_weak_gradients
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.simulator.targets.library import load_target

CAMERA = CameraIntrinsics(480, 300, 750.0, 750.0, 239.5, 149.5)
T_M = np.array([0.05, -0.05, 4.2])
SIGMA, DARK = 2.0, 4.0

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture(scope="module")
def estimator() -> PoseEstimator:
    return PoseEstimator(board_model(load_target("tango")), CAMERA)


def frame_of(craft: PreparedTarget, q: np.ndarray, sun: np.ndarray) -> Observation:
    """The board's own drawing lit by the Sun alone (``sun``: camera axes), with its shadows and noise."""
    faces, R, fine = craft.model.faces, quat.matrix(q), 3
    assert faces is not None
    plain = ImagePatch(np.zeros((300, 480), np.float32), SIGMA, 0.0, 0.0, 1.0, fine)
    seen = draw_faces(faces, order_faces(faces, -R.T @ T_M), CAMERA, R, T_M, plain)
    s = R.T @ sun
    light = np.array([120.0, 230.0, 160.0])[faces.material % 3] * np.clip(faces.normals @ s, 0, 1)
    drawn = np.concatenate([[0.0], light])[seen].astype(np.float32)
    drawn[ShadowMap.of(faces, s, 400).shadows(faces, seen, plain, CAMERA, R, T_M)] = 0.0
    small = blurred(drawn.reshape(300, fine, 480, fine).mean(axis=(1, 3)), 1.0)
    noisy = small + DARK + np.random.default_rng(3).normal(0, SIGMA, small.shape)
    frame = Observation(np.clip(np.rint(noisy), 0, 255).astype(np.uint8))
    frame.noise, frame.background = SIGMA, DARK
    return frame


def sideways(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """An attitude and a Sun 80 to 115 deg from the line of sight."""
    rng = np.random.default_rng(seed)
    q = quat.normalise(rng.normal(size=4))
    a, b = rng.uniform(0, 6.28), np.radians(rng.uniform(80, 115))
    return q, np.array([np.cos(a) * np.sin(b), np.sin(a) * np.sin(b), -np.cos(b)])


# Of 150 draws two whose size the proposal misses (0.88 and 0.87 of it) and that are found with all ways to round
# (kernels, NumPy and OpenBLAS of older processors): 0.7 to 1.8 deg off each time. Most others come out either way.
@pytest.mark.parametrize("seed", [26, 66])
def test_a_craft_of_which_a_part_is_lit_is_found(estimator: PoseEstimator, seed: int) -> None:
    craft, (q, sun) = estimator.target, sideways(seed)
    frame = frame_of(craft, q, sun)
    reduced, _ = shrink(frame.image, 0, 0, 480, 300, 120)
    true_px = 2 * CAMERA.fx_px * craft.radius_m / T_M[2]
    # the look at what is lit is wrong, or this would test nothing
    regions, _, _ = propose_regions(reduced, eliminate_weak_gradients(reduced), SIGMA / 4)
    first = estimator.setup.learned
    assert first is not None
    proposal = first.propose(frame.image, SIGMA, [r for r in regions if r.diagonal_px > 24], 1, reduced)[0]
    assert proposal.crop.diameter_px < 0.9 * true_px
    near = np.degrees([quat.angle_rad(p, q) for p in proposal.q])
    far = np.abs(np.log(np.linalg.norm(proposal.t, axis=1) / np.linalg.norm(T_M)))
    assert not np.any((near < 20) & (far < 0.1))
    source = learned_hypotheses(craft, frame, proposal)[0].source
    found, places = hypotheses_of_places(craft, frame, first, proposal, source, reduced)
    best = refine_many_scales(craft, frame, found, places)[0]
    assert np.degrees(quat.angle_rad(best.q, q)) < 5
    assert np.linalg.norm(best.t - T_M) < 0.05 * T_M[2]
