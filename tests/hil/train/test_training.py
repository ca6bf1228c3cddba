"""Training: samples are what a turned camera would have taken, and a network learns what can be learned."""

import numpy as np
import pytest

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.vectors import swing
from flyaround.hil.board.net.network_camera import NetworkCamera
from flyaround.hil.evaluate.mean_predictor import mean_predictor
from flyaround.hil.train.pictures import FINER, LabelledPictures, labelled, sample
from flyaround.hil.train.residual_network import ARCHITECTURES

SMALL = NetworkCamera(64, 40, 100.0)


def spots(n, rng):
    """Pictures of three lights of a craft at random poses, and where a pinhole has them."""
    fine = SMALL.enlarged(FINER)
    lights = np.array([[0.5, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, -0.4]])
    q = quat.normalise(rng.normal(size=(n, 4)))
    z = rng.uniform(3.0, 6.0, n)
    t = np.stack([0.15 * z * rng.uniform(-1, 1, n), 0.1 * z * rng.uniform(-1, 1, n), z], axis=1)
    rays = fine.rays()
    out = np.zeros((n, fine.height_px, fine.width_px))
    for k in range(n):
        for light, level in zip(lights, (1.0, 0.6, 0.35), strict=True):
            p = quat.matrix(q[k]) @ light + t[k]
            d2 = ((rays - p[:2] / p[2]) ** 2).sum(axis=-1) * fine.f_px**2
            out[k] = np.maximum(out[k], level * np.exp(-d2 / 18.0))
    return LabelledPictures(SMALL, np.rint(255 * out).astype(np.uint8), q, t), lights


def test_a_turned_sample_shows_its_lights_where_its_labels_put_them():
    rng = np.random.default_rng(0)
    pictures, lights = spots(20, rng)
    drawn = sample(pictures, rng, 30)
    rays = SMALL.rays()
    turned = 0
    for picture, q, place, log_range in zip(
        drawn.pictures, drawn.q_wxyz, drawn.place, drawn.log_range, strict=True
    ):
        ray = np.append(place * SMALL.half_view, 1.0)
        direction = ray / np.linalg.norm(ray)
        R = swing(direction) @ quat.matrix(q)
        p = R @ lights[0] + np.exp(log_range) * direction
        y, x = np.unravel_index(int(np.argmax(picture)), picture.shape)
        inside = np.all(np.abs(p[:2] / p[2]) < 0.9 * SMALL.half_view)
        if inside:
            assert np.abs(rays[y, x] - p[:2] / p[2]).max() * SMALL.f_px < 1.6
            turned += 1
    assert turned > 15


def test_labels_carry_the_poses_of_the_pictures():
    rng = np.random.default_rng(1)
    pictures, _ = spots(5, rng)
    same = labelled(np.stack(pictures.signal), pictures.camera, pictures.q_wxyz, pictures.t_m)
    for q, seen, t in zip(pictures.q_wxyz, same.q_wxyz, pictures.t_m, strict=True):
        back = quat.multiply(quat.from_matrix(swing(t / np.linalg.norm(t))), seen)
        assert quat.angle_rad(quat.normalise(back)[None], q)[0] < 1e-6
    np.testing.assert_allclose(np.exp(same.log_range), np.linalg.norm(pictures.t_m, axis=1))


def test_the_mean_predictor_errs_as_random_rotations_do():
    rng = np.random.default_rng(2)
    q = quat.normalise(rng.normal(size=(4000, 4)))
    t = rng.normal([0.0, 0.0, 10.0], [0.0, 0.0, 1.0], (4000, 3))
    m = mean_predictor(q, t)
    # the mean angle between random rotations is pi / 2 + 2 / pi; of a normal, sigma times the root of 2 over pi
    assert m.mean_E_R_deg == pytest.approx(np.degrees(np.pi / 2 + 2 / np.pi), abs=1.5)
    assert m.mean_E_T_m == pytest.approx(np.sqrt(2 / np.pi), abs=0.05)
    # one pose is its own mean
    assert mean_predictor(q[:1], t[:1]).mean_E_R_deg == pytest.approx(0.0, abs=1e-5)


def test_sizes_are_counted_as_they_come_out():
    torch = pytest.importorskip("torch", reason="the extra 'train'")
    from flyaround.hil.train.forward import forward
    from flyaround.hil.train.layers import trainable

    for network in ARCHITECTURES.values():
        weights = trainable(network.start(50, 37, 64, 0))
        place, logits, _ = forward(network, weights, None, torch.zeros(2, 37, 50))
        assert (tuple(place.shape), tuple(logits.shape)) == ((2, 3), (2, 64))


def test_the_board_computes_what_was_trained(tmp_path):
    torch = pytest.importorskip("torch", reason="the extra 'train'")
    from flyaround.hil.board.net.network_file import HeldOutErrors, NetworkFile
    from flyaround.hil.train.forward import folded, forward
    from flyaround.hil.train.layers import trainable
    from flyaround.hil.train.onnx_file import onnx_bytes, sheet

    rng = np.random.default_rng(3)
    network = ARCHITECTURES["small"]
    weights = trainable(network.start(64, 40, 128, 1))
    for value in weights.values():
        if value.ndim == 1:
            value.data.add_(torch.from_numpy(rng.normal(0, 0.2, tuple(value.shape)).astype(np.float32)))
    pictures = torch.from_numpy(rng.normal(size=(8, 40, 64)).astype(np.float32))
    _, _, seen = forward(network, weights, None, pictures)
    place, logits, _ = forward(network, weights, seen, pictures)
    about = sheet(("tango", ""), SMALL, 128, (1.0, 0.5), HeldOutErrors(0.1, 0.1, 0.1), {})
    path = tmp_path / "net.onnx"
    path.write_bytes(onnx_bytes(network, folded(network, weights | seen), about))
    file = NetworkFile.read(path)
    net = file.open()
    for k in range(8):
        got = file.run(net, pictures[k].numpy())
        for mine, theirs in zip(got, (place[k], logits[k]), strict=True):
            wanted = theirs.detach().numpy()
            np.testing.assert_allclose(mine, wanted, atol=1e-4 * np.abs(wanted).max())


def test_a_network_learns_where_three_lights_are():
    torch = pytest.importorskip("torch", reason="the extra 'train'")
    from flyaround.hil.train.fitting import Budget
    from flyaround.hil.train.train import PoseTraining

    # more threads than free processors wait for each other
    torch.set_num_threads(1)
    rng = np.random.default_rng(4)
    pictures, _ = spots(60, rng)
    log_range = np.log(np.linalg.norm(pictures.t_m, axis=1))
    scale = (float(log_range.mean()), float(log_range.std()))
    lines = []
    training = PoseTraining(ARCHITECTURES["small"], pictures, 128, scale, 0, "cpu")
    training.run(Budget(steps=40), lambda done, text, _means: lines.append((done, text)))
    numbers = [[float(x) for x in text.split("loss ")[1].split()] for _, text in lines]
    assert lines[-1][0] == 1.0
    # the place first; attitudes take longer; these are running means of losses
    assert numbers[-1][1] < 0.96 * numbers[0][1]
    assert numbers[-1][0] < numbers[0][0]


def test_a_mistake_of_train_is_one_sentence(tmp_path, capsys):
    from flyaround.__main__ import run

    for words, says in (
        (["train", str(tmp_path), "-o", str(tmp_path / "a.pt")], ".onnx"),
        (["train", str(tmp_path), "-o", str(tmp_path / "no" / "a.onnx")], "folder"),
        (["train", str(tmp_path), "-o", str(tmp_path / "a.onnx"), "--network", "huge"], "resnet18"),
        # no data set, or no PyTorch
        (["train", str(tmp_path), "-o", str(tmp_path / "a.onnx")], ""),
    ):
        assert run(words) == 2
        error = capsys.readouterr().err
        assert says in error
        assert "Traceback" not in error
    assert not list(tmp_path.glob("*"))
