"""The estimator of a network: what it is shown, what its numbers mean, who gets one."""

import dataclasses
import threading

import cv2
import numpy as np
import pytest
from drawn_craft import Craft
from hil_loop import Loop
from random_network import CAMERA, CLASSES, write_network

from flyaround.__main__ import run
from flyaround.hil.board.agent import run_board
from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.vectors import swing
from flyaround.hil.board.methods import check_method_name, make_estimator
from flyaround.hil.board.net.attitude_classes import class_attitudes, mean_attitude, softmax
from flyaround.hil.board.net.network_camera import NetworkCamera, PictureReducer, standardise

LENS = CameraIntrinsics(480, 300, 750.0, 750.0, 239.5, 149.5)
BENT = dataclasses.replace(LENS, distortion_model="brown_conrady", distortion=(-0.3, 0.1, 1e-3, -1e-3, 0.0))


@pytest.mark.parametrize("camera", [LENS, BENT, CameraIntrinsics(960, 700, 1400.0, 1400.0, 500.0, 340.0)])
def test_a_picture_is_seen_through_the_networks_own_lens(camera):
    """A spot in some direction is where a pinhole has it, whatever camera took the picture."""
    seen = NetworkCamera(160, 100, 250.0)
    reduce = PictureReducer.prepare(seen, camera)
    for x, y in ((0.0, 0.0), (0.12, -0.08), (-0.2, 0.1)):
        u, v = camera.pixels(np.array([x, y, 1.0]))
        image = np.zeros((camera.height_px, camera.width_px), np.uint8)
        cv2.circle(image, (round(u), round(v)), 6, 255, -1)
        picture = reduce(image)
        assert picture.shape == (100, 160)
        total = (picture**2).sum()
        rays = seen.rays()
        found = [float((picture**2 * rays[..., k]).sum() / total) for k in (0, 1)]
        assert found == pytest.approx([x, y], abs=0.6 / camera.fx_px + 0.1 / seen.f_px)


def test_depth_and_exposure_of_a_picture_change_little():
    rng = np.random.default_rng(0)
    image = rng.integers(0, 200, (300, 480)).astype(np.uint8)
    reduce = PictureReducer.prepare(CAMERA, LENS)
    a = standardise(reduce(image))
    deep = (image.astype(np.uint16) * 257).astype(np.uint16)
    np.testing.assert_allclose(standardise(reduce(deep)), a, atol=0.02)
    np.testing.assert_allclose(standardise(reduce((image // 2).astype(np.uint8))), a, atol=0.1)
    assert a.mean() == pytest.approx(0.0, abs=1e-5)


def test_the_mean_attitude_is_of_one_neighbourhood_and_lies_between_classes():
    grid = class_attitudes(2304)
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(40):
        q = quat.normalise(rng.normal(size=4))
        other = quat.multiply(q, np.array([0.0, 0.0, 0.0, 1.0]))
        likely = sum(
            weight * np.exp(-0.5 * (quat.angle_rad(grid, p) / np.radians(12.0)) ** 2)
            for weight, p in ((0.6, q), (0.4, other))
        )
        found, held = mean_attitude(likely / likely.sum())
        errors.append(np.degrees(quat.angle_rad(found[None], q)[0]))
        assert 0.4 < held < 0.7
    assert max(errors) < 6.0
    assert softmax(np.array([0.0, 0.0])) == pytest.approx([0.5, 0.5])


def craft_network(tmp_path, **options):
    model = Craft().model()
    return model, write_network(tmp_path / "net.npz", (model.name, model.sha256), **options)


def test_what_it_is_sure_of_is_the_pose(tmp_path):
    model, path = craft_network(tmp_path, sure=7)
    estimator = make_estimator(model, LENS, f"net:{path}")
    image = np.zeros((300, 480), np.uint8)
    image[100:150, 200:260] = 180
    result = estimator.estimate(image)
    assert result.accepted
    assert result.method == "net:net.npz"
    t = result.t_camera_from_target_m
    assert np.linalg.norm(t) == pytest.approx(np.exp(1.5), rel=1e-5)
    expected = quat.multiply(quat.from_matrix(swing(t / np.linalg.norm(t))), class_attitudes(CLASSES)[7])
    assert quat.angle_rad(quat.normalise(expected)[None], result.q_camera_from_target_wxyz)[0] < 1e-3
    assert result.covariance.shape == (6, 6)
    assert set(result.stages_ms) == {"reduce", "network", "pose"}
    # a bad picture is declined as by any estimator
    assert not estimator.estimate(None).accepted
    assert "picture is" in estimator.estimate(image[:100]).reason


def test_what_it_is_not_sure_of_is_declined_with_its_best_pose(tmp_path):
    model, path = craft_network(tmp_path)
    image = np.random.default_rng(0).integers(0, 255, (300, 480)).astype(np.uint8)
    result = make_estimator(model, LENS, f"net:{path}").estimate(image)
    assert not result.accepted
    assert result.reason == "several attitudes are equally likely"
    assert result.q_camera_from_target_wxyz is not None


def test_a_network_of_another_craft_and_a_solver_are_refused(tmp_path):
    path = write_network(tmp_path / "net.npz", ("dragon", ""))
    with pytest.raises(BoardModelError, match="trained on dragon"):
        make_estimator(Craft().model(), LENS, f"net:{path}")
    with pytest.raises(BoardModelError, match="leave it out"):
        make_estimator(Craft().model(), LENS, f"net:{path}", solver="epnp")
    for name in ("guess", "net:", "net:none.npz"):
        with pytest.raises(BoardModelError):
            check_method_name(name)


def test_commands_say_what_is_wrong_with_a_network(tmp_path, capsys):
    (tmp_path / "bad.npz").write_bytes(b"no network")
    bad = f"net:{tmp_path / 'bad.npz'}"
    for words in (
        ["estimate", "x.png", "--method", bad],
        ["evaluate", str(tmp_path), "--method", bad],
        ["hil", "board", "tcp://127.0.0.1:1", "--method", bad],
    ):
        assert run(words) == 2
        assert "bad.npz" in capsys.readouterr().err


def test_a_board_answers_with_a_network(tmp_path):
    """In the loop: `hil board --method net:FILE` on a host's pictures."""
    from hil_loop import frames

    from flyaround.hil.board_model.write import write_board_model
    from flyaround.simulator.targets.library import load_target

    path = write_network(tmp_path / "net.npz", ("tango", ""), sure=3)
    write_board_model(load_target("tango"), tmp_path / "tango.board.json")
    rows = []
    run_it = Loop(lambda url: run_board(url, tmp_path / "tango.board.json", f"net:{path}", silence_s=60.0))

    def pictures():
        for frame in frames(3):
            image = np.tile(np.arange(64, dtype=np.uint8), (64, 1))
            from hil_loop import made_frame

            yield made_frame(frame.number, image, every_s=0.05)

    summary = run_it.run(pictures(), on_row=rows.append, timeout_s=30.0)
    assert summary.board is not None
    assert summary.board.method.startswith("net:")
    assert [row.outcome for row in rows] == ["accepted"] * 3
    assert all(row.t_m is not None for row in rows)
    assert threading.active_count() < 20
