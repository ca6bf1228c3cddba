"""Training: samples are what a turned camera would have taken, and a network learns what can be learned."""

import numpy as np
import pytest

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.vectors import swing
from flyaround.hil.board.net.network_camera import NetworkCamera
from flyaround.hil.board.net.network_file import HeldOutErrors, NetworkFile
from flyaround.hil.board.net.residual_network import ARCHITECTURES
from flyaround.hil.evaluate.mean_predictor import mean_predictor
from flyaround.hil.train.pictures import OVERSAMPLING, LabelledPictures, TrainingSet, sample, with_labels
from flyaround.simulator.errors import UserError

SMALL = NetworkCamera(64, 40, 100.0)


def spots(n, rng):
    """Pictures of three lights of a craft at random poses, and where a pinhole has them."""
    fine = SMALL.enlarged(OVERSAMPLING)
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
    same = with_labels(np.stack(pictures.signal), pictures.camera, pictures.q_wxyz, pictures.t_m)
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


@pytest.mark.parametrize(("architecture", "size"), [("small", (64, 40)), ("resnet18", (50, 37))])
def test_the_board_computes_what_was_trained(architecture, size, tmp_path):
    torch = pytest.importorskip("torch", reason="the extra 'train'")
    from flyaround.hil.train.residual_network import ResidualNetwork

    torch.manual_seed(1)
    rng = np.random.default_rng(3)
    network = ResidualNetwork(ARCHITECTURES[architecture], *size, 128)
    with torch.no_grad():
        for value in network.parameters():
            if value.ndim == 1:
                value.add_(torch.from_numpy(rng.normal(0, 0.2, tuple(value.shape)).astype(np.float32)))
    pictures = torch.from_numpy(rng.normal(size=(4, *size[::-1])).astype(np.float32))
    network(pictures)
    place, logits = network.eval()(pictures)
    camera = NetworkCamera(*size, 100.0)
    errors = HeldOutErrors(0.1, 0.1, 0.1)
    made = NetworkFile("", "tango", "", camera, 128, 1.0, 0.5, errors, architecture, network.folded())
    (tmp_path / "net.npz").write_bytes(made.to_bytes({}))
    file = NetworkFile.read(tmp_path / "net.npz")
    for k in range(4):
        for mine, theirs in zip(file.run(pictures[k].numpy()), (place[k], logits[k]), strict=True):
            wanted = theirs.detach().numpy()
            np.testing.assert_allclose(mine, wanted, atol=1e-4 * np.abs(wanted).max())


def test_the_same_seed_gives_the_same_weights():
    torch = pytest.importorskip("torch", reason="the extra 'train'")
    from flyaround.hil.train.fitting import Budget
    from flyaround.hil.train.train import PoseTraining

    torch.set_num_threads(1)
    pictures, _ = spots(10, np.random.default_rng(4))

    def trained(seed):
        training = PoseTraining(ARCHITECTURES["small"], pictures, 128, (1.0, 0.5), seed, "cpu")
        return training.run(Budget(steps=2), lambda _done, _text: None)

    first, again, other = trained(0), trained(0), trained(1)
    assert all(np.array_equal(first[name], again[name]) for name in first)
    assert not np.array_equal(first["stem"], other["stem"])


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
    training.run(Budget(steps=40), lambda done, text: lines.append((done, text)))
    numbers = [[float(x) for x in text.split("loss ")[1].split()] for _, text in lines]
    assert lines[-1][0] == 1.0
    # the place first; attitudes take longer; these are running means of losses
    assert numbers[-1][1] < 0.96 * numbers[0][1]
    assert numbers[-1][0] < numbers[0][0]


def test_pictures_of_an_unusable_shape_are_refused_before_training(monkeypatch, tmp_path):
    pytest.importorskip("torch", reason="the extra 'train'")
    from flyaround.hil.train import train

    low = NetworkCamera(64, 8, 100.0)
    pictures = LabelledPictures(low, np.zeros((2, 16, 128), np.uint8), np.ones((2, 4)), np.ones((2, 3)))
    data = TrainingSet(
        ("tango", ""), CameraIntrinsics(640, 80, 1e3, 1e3, 319.5, 39.5), pictures, pictures, (0, 1)
    )
    monkeypatch.setattr(train, "read_training_set", lambda *_: data)
    with pytest.raises(UserError, match="64 x 8"):
        train.train_network(tmp_path, tmp_path / "a.npz", width_px=64)


def test_a_mistake_of_train_is_one_sentence(tmp_path, capsys):
    from flyaround.__main__ import run

    for words, says in (
        (["train", str(tmp_path), "-o", str(tmp_path / "a.pt")], ".npz"),
        (["train", str(tmp_path), "-o", str(tmp_path / "no" / "a.npz")], "folder"),
        (["train", str(tmp_path), "-o", str(tmp_path / "a.npz"), "--network", "huge"], "resnet18"),
        # no data set, or no PyTorch
        (["train", str(tmp_path), "-o", str(tmp_path / "a.npz")], ""),
    ):
        assert run(words) == 2
        error = capsys.readouterr().err
        assert says in error
        assert "Traceback" not in error
    assert not list(tmp_path.glob("*"))
