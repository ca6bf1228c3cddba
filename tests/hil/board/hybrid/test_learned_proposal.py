"""The learned proposal: its layers, what it is shown, the faces' subspaces, and who gets one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from kernel_oracle.learned import convolve
from scipy.signal import correlate

from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.model.rasteriser import draw_faces, order_faces
from flyaround.hil.board.hybrid.propose import learned as look_folder
from flyaround.hil.board.hybrid.propose.learned.attitude_basis import ANCHORS, bumps, even_attitudes
from flyaround.hil.board.hybrid.propose.learned.learned_proposal import (
    LearnedProposer,
    network_for,
)
from flyaround.hil.board.hybrid.propose.learned.network import INPUT_FILL, INPUT_PX, ProposalNetwork
from flyaround.hil.board.hybrid.propose.learned.network_input import ImageCrop, crop_image
from flyaround.hil.board.hybrid.propose.learned.view_subspaces import ViewSubspaces
from flyaround.hil.board.svd.region_of_interest import Region
from flyaround.hil.board_model.write import labels_alone
from flyaround.simulator.targets.library import load_target

CAMERA = CameraIntrinsics(480, 300, 750.0, 750.0, 239.5, 149.5)


def faces_seen(model: BoardModel, q: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """(300, 480) numbers of the faces that show, from 1, of a craft whose centre is at (3,) m in the camera's frame."""
    assert model.faces is not None
    R = quat.matrix(q)
    t = centre - R @ model.centre_m
    canvas = ImagePatch(np.zeros((300, 480), np.float32), 1.0, 0.0, 0.0, 1.0, 1)
    return draw_faces(model.faces, order_faces(model.faces, -R.T @ t), CAMERA, R, t, canvas)


@pytest.mark.parametrize(("side", "stride"), [(5, 2), (3, 2), (3, 1)])
def test_a_convolution_is_the_correlation_of_the_definition(side: int, stride: int) -> None:
    rng = np.random.default_rng(side + stride)
    x, kernel = rng.normal(size=(2, 12, 12, 3)), rng.normal(size=(side, side, 3, 4))
    before = (side - stride) // 2 if stride > 1 else side // 2
    padded = np.pad(x, ((0, 0), (before, side), (before, side), (0, 0)))
    for b in range(2):
        for d in range(4):
            whole = correlate(padded[b], kernel[..., d], "valid")[..., 0]
            expected = whole[:12:stride, :12:stride][: 12 // stride, : 12 // stride]
            np.testing.assert_allclose(convolve(x, kernel, stride)[b, ..., d], expected, atol=2e-5)


@pytest.mark.slow
def test_the_board_computes_what_was_trained(tmp_path: Path) -> None:
    torch = pytest.importorskip("torch", reason="the extra 'train'")
    from tools.train import learned_proposal as trainer

    rng = np.random.default_rng(2)
    inputs = rng.normal(0, 0.5, (8, INPUT_PX, INPUT_PX, 2)).astype(np.float32)
    weights = trainer.start_weights(1)
    _, seen = trainer.forward(weights, None, torch.from_numpy(inputs))
    # statistics of another batch: the running ones that training ends with
    other = {k: v * torch.from_numpy(0.5 + rng.random(tuple(v.shape), np.float32)) for k, v in seen.items()}
    trained, _ = trainer.forward(weights, other, torch.from_numpy(inputs))
    trainer.write(tmp_path / "net.npz", trainer.folded(weights | other), "tango")
    coefficients, rest = ProposalNetwork.read(str(tmp_path / "net.npz"))(inputs)
    expected = trained.detach().numpy()
    scale = np.abs(expected).max()
    np.testing.assert_allclose(coefficients, expected[:, :ANCHORS], atol=5e-3 * scale)
    np.testing.assert_allclose(rest, expected[:, ANCHORS:], atol=5e-3 * scale)


def test_looks_turned_by_quarters_agree_on_the_attitude(views: ViewSubspaces) -> None:
    q = views.q[4321]
    # what a perfect network says of a picture that a camera turned by so many quarters to the left takes
    angle = -0.5 * np.pi * np.arange(4)
    left = np.stack([np.cos(angle / 2), 0 * angle, 0 * angle, np.sin(angle / 2)], axis=-1)
    said = bumps(quat.multiply(left, q[None])) @ bumps(even_attitudes(ANCHORS))
    assert int(views.likelihood(said[None]).argmax()) == 4321


def test_a_gaze_sees_a_point_where_the_camera_has_it_and_moves_onto_it() -> None:
    picture = np.zeros((300, 480), np.uint8)
    picture[61:64, 331:334] = 200
    diameter = 90.0
    near = ImageCrop.at(CAMERA, 320.0, 75.0, diameter)
    small = crop_image(picture, CAMERA, near, INPUT_PX, INPUT_FILL * INPUT_PX)
    y, x = (float(v) for v in np.argwhere(small > 0.9 * small.max()).mean(axis=0))
    shift = (np.array([x, y]) - 0.5 * (INPUT_PX - 1)) / (0.5 * INPUT_PX)
    moved = near.moved(750.0, shift, np.log(1.5))
    u, v = CAMERA.pixels(moved.direction)
    assert np.hypot(u - 332, v - 62) < 1.5
    assert moved.diameter_px == pytest.approx(1.5 * diameter)


def test_faces_tell_the_attitude_place_and_size_of_a_craft_of_any_brightness(
    tango: BoardModel, views: ViewSubspaces
) -> None:
    assert tango.faces is not None
    rng = np.random.default_rng(5)
    found = 0
    for _ in range(6):
        q, centre = quat.normalise(rng.normal(size=4)), np.array([0.3, -0.2, 8.0])
        seen = faces_seen(tango, q, centre)
        bright = np.concatenate([[0], rng.uniform(20, 200, tango.faces.groups)])
        picture = bright[np.concatenate([[0], tango.faces.group + 1])[seen]] + rng.normal(0, 3, seen.shape)
        crop = ImageCrop(centre / np.linalg.norm(centre), 0.97 * 2 * 750.0 * tango.radius_m / 8.0)
        # a network that has no more than a vague idea
        seen_q = quat.multiply(quat.from_rotvec([0.2, -0.2, 0.1]), q)
        angle = -0.5 * np.pi * np.arange(4)
        left = np.stack([np.cos(angle / 2), 0 * angle, 0 * angle, np.sin(angle / 2)], axis=-1)
        vague = 4.0 * bumps(quat.multiply(left, seen_q[None]))[None]
        best, move, _ = views.rank(np.clip(picture, 0, 255).astype(np.uint8), CAMERA, crop, vague, 8, 0.19)
        near = np.degrees(quat.angle_rad(quat.multiply(quat.from_matrix(crop.swing()), best), q)) < 12
        found += bool(near.any())
        assert np.abs(move).max() < 0.2
    assert found >= 5


def test_only_the_model_it_was_trained_for_gets_a_network(tango: BoardModel) -> None:
    assert network_for(tango) is not None
    assert network_for(replace(tango, name="another")) is None
    assert network_for(replace(tango, name="../tango")) is None
    edges = tuple(replace(e, a_m=1.1 * e.a_m, b_m=1.1 * e.b_m) for e in tango.wireframe)
    assert network_for(replace(tango, wireframe=edges)) is None


@pytest.mark.parametrize(
    "path", sorted((Path(look_folder.__path__[0]) / "weights").glob("*.npz")), ids=lambda p: p.stem
)
def test_every_network_that_is_shipped_is_of_its_craft_as_it_is_now(path: Path, tmp_path: Path) -> None:
    file = tmp_path / "board.json"
    file.write_bytes(msgspec.json.encode(labels_alone(load_target(path.stem))))
    net = network_for(BoardModel.read(str(file)))
    assert net is not None
    assert net.name == path.stem


@pytest.mark.slow
@pytest.mark.gl
@pytest.mark.parametrize(("recipe", "least"), [("eval-black", 10), ("eval-earth", 8)])
def test_the_true_pose_is_mostly_among_the_proposed_ones(tango: BoardModel, recipe: str, least: int) -> None:
    from flyaround.hil.board.hybrid.image.edge_field import shrink
    from flyaround.hil.board.hybrid.image.noise import noise_sigma
    from flyaround.hil.board.hybrid.propose.regions import REDUCTION, propose_regions
    from flyaround.hil.board.svd.weak_gradients import eliminate_weak_gradients
    from flyaround.simulator.frame import take_frame
    from flyaround.simulator.recipes.plan import plan_recipe
    from flyaround.simulator.render.renderer import Renderer

    plan = plan_recipe(recipe, 40, seed=6301)
    c = plan.camera
    camera = CameraIntrinsics(c.width_px, c.height_px, c.fx_px, c.fy_px, c.cx_px, c.cy_px)
    proposer = LearnedProposer.prepare(tango, camera)
    assert proposer is not None
    tried = found = 0
    with Renderer() as renderer:
        for k in range(40):
            frame = take_frame(renderer, plan.scene(k), plan.target)
            if frame.truth is None or not frame.truth.feasible:
                continue
            image = frame.image
            noise = noise_sigma(image, 255.0)
            small, _ = shrink(image, 0, 0, image.shape[1], image.shape[0], max(image.shape) // REDUCTION)
            regions, _, _ = propose_regions(small, eliminate_weak_gradients(small), noise / REDUCTION)
            truth = frame.truth
            q, t = (np.array(v) for v in (truth.q_camera_from_target_wxyz, truth.t_camera_from_target_m))
            near = [
                (quat.angle_rad(g.q, q) < np.radians(15)) & (np.abs(g.t[:, 2] / t[2] - 1) < 0.2)
                for g in proposer.propose(image, noise, regions[:6], 2)
            ]
            found += any(n.any() for n in near)
            tried += 1
            if tried == 12:
                break
    assert tried == 12
    assert found >= least


def test_of_many_gazes_the_one_at_the_craft_is_kept_and_names_its_attitude(tango: BoardModel) -> None:
    proposer = LearnedProposer.prepare(tango, CAMERA)
    assert proposer is not None
    assert tango.faces is not None
    rng = np.random.default_rng(8)
    right = near = 0
    for _ in range(5):
        q, centre = quat.normalise(rng.normal(size=4)), np.array([0.2, -0.1, 7.0])
        seen = faces_seen(tango, q, centre)
        lit = np.clip(tango.faces.normals @ (quat.matrix(q).T @ np.array([0.5, -0.3, -0.8])), 0.05, 1)
        bright = np.concatenate([[0], np.array([60, 200, 140])[tango.faces.material % 3] * lit])
        picture = np.clip(bright[seen] + rng.normal(0, 3, seen.shape), 0, 255).astype(np.uint8)
        size = 2 * 750.0 * tango.radius_m / 7.0
        u, v = CAMERA.pixels(centre)
        crops = [
            ImageCrop.at(CAMERA, u + dx * size, v + dy * size, s * size)
            for s, dx, dy in ((0.6, 0.3, 0), (0.7, -0.3, 0.1), (1.6, 0, -0.5), (1.0, 0, 0), (1.8, 0.6, 0.4))
        ]
        kept = proposer.propose_at(picture, 3.0, Region(0, 0, 480, 300, "whole"), crops, 2)
        assert len(kept) == 2
        at = [g for g in kept if g.crop.diameter_px == pytest.approx(size, rel=0.01)]
        right += bool(at)
        near += any(np.degrees(quat.angle_rad(g.q, q)).min() < 15 for g in at)
    assert right >= 4
    assert near >= 3
