"""The keypoint network: its crops, its file, and the poses found from its distributions."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import replace

import cv2
import numpy as np
import pytest

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.propose.keypoints.calibration import Calibration
from flyaround.hil.board.hybrid.propose.keypoints.head import SHAPES, KeypointHead
from flyaround.hil.board.hybrid.propose.keypoints.image_crop import ImageCrop, crop_image
from flyaround.hil.board.hybrid.propose.keypoints.keypoint_proposal import LearnedProposer
from flyaround.hil.board.hybrid.propose.keypoints.network import network_for, trunk_bytes, trunk_sha256
from flyaround.hil.board.hybrid.propose.keypoints.network_input import INPUT_FILL, INPUT_PX, channels
from flyaround.hil.board.hybrid.propose.keypoints.network_output import (
    BIN_WIDTH,
    BINS,
    HALF_RANGE,
    keypoints_m,
)
from flyaround.hil.board.hybrid.propose.keypoints.pose_search import most_likely_position, pose_modes
from flyaround.hil.board.hybrid.propose.keypoints.single_precision import in_single_precision
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.simulator.targets.library import load_target

CAMERA = CameraIntrinsics(480, 300, 750.0, 750.0, 239.5, 149.5)
FOCAL = 5.0

# Centres of the bins, relative to the centre of the input [half sides].
CENTRES = (np.arange(BINS) + 0.5) * BIN_WIDTH - HALF_RANGE


def points_of(model: BoardModel) -> np.ndarray:
    return (keypoints_m(model) - model.centre_m) / model.radius_m


def distributions(points: np.ndarray, *poses: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Log-probabilities of keypoints seen at any of these poses, each as likely, to 1.5 bins."""
    p = np.full((len(points), 2, BINS), 1e-5)
    for q, t in poses:
        seen = points @ quat.matrix(q).T + t
        at = FOCAL * seen[:, :2] / seen[:, 2:]
        p += np.exp(-0.5 * ((CENTRES - at[..., None]) / (1.5 * BIN_WIDTH)) ** 2)
    return np.log(p / p.sum(axis=-1, keepdims=True))


def log_size(t: np.ndarray) -> float:
    """What the network says of a craft there."""
    return float(np.log(np.hypot(1.0, FOCAL / INPUT_FILL) / t[2]))


def poses(seed: int) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(seed)
    away = float(np.hypot(1.0, FOCAL / INPUT_FILL))
    return [
        (
            quat.normalise(rng.normal(size=4)),
            np.array([*rng.uniform(-0.4, 0.4, 2), away * rng.uniform(0.92, 1.08)]),
        )
        for _ in range(2)
    ]


@pytest.mark.parametrize("seed", range(6))
def test_the_pose_is_found_from_distributions_of_keypoints(tango: BoardModel, seed: int) -> None:
    points = points_of(tango)
    q, t = poses(seed)[0]
    modes = pose_modes(distributions(points, (q, t)), points, FOCAL, log_size(t), 16)
    assert np.degrees(quat.angle_rad(modes.q[0], q)) < 1.0
    assert np.linalg.norm(modes.t[0] - t) < 0.02 * t[2]
    assert modes.log_likelihood[0] == modes.log_likelihood.max()
    near = most_likely_position(distributions(points, (q, t)), points, FOCAL, log_size(t))
    assert np.linalg.norm((near - t)[:2]) < 0.35
    assert near[2] == pytest.approx(t[2])


@pytest.mark.parametrize("seed", range(4))
def test_each_of_two_poses_that_are_as_likely_is_proposed(tango: BoardModel, seed: int) -> None:
    points = points_of(tango)
    both = poses(seed)
    both[1] = (both[1][0], both[0][1])
    modes = pose_modes(distributions(points, *both), points, FOCAL, log_size(both[0][1]), 16)
    for q, _ in both:
        assert min(np.degrees(quat.angle_rad(m, q)) for m in modes.q[:4]) < 3.0


def test_a_crop_is_what_a_turned_camera_sees() -> None:
    y, x = np.mgrid[:300, :480]
    image = (120 + 0.3 * x - 0.2 * y).astype(np.float32)
    crop = ImageCrop.at(CAMERA, 300.0, 100.0, 60.0)
    seen = crop_image(image, CAMERA, crop, INPUT_PX, INPUT_FILL * INPUT_PX)
    assert seen[63:65, 63:65].mean() == pytest.approx(120 + 0.3 * 300 - 0.2 * 100, abs=0.3)
    # a pixel of the crop is 60 / (0.72 * 128) of the image's
    assert np.diff(seen[64]).mean() == pytest.approx(0.3 * 60 / (INPUT_FILL * INPUT_PX), rel=0.05)
    moved = crop.moved(750.0, np.array([0.5, 0.0]), np.log(2.0))
    u, v = CAMERA.pixels(moved.direction)
    assert u == pytest.approx(300 + 0.5 * 0.5 * 60 / INPUT_FILL, abs=0.5)
    assert v == pytest.approx(100, abs=0.5)
    assert moved.diameter_px == pytest.approx(120)


def test_the_input_does_not_depend_on_exposure() -> None:
    rng = np.random.default_rng(1)
    picture = rng.uniform(0, 100, (1, INPUT_PX, INPUT_PX)).astype(np.float32)
    one, other = (channels(picture * k, np.array([2.0 * k])) for k in (1.0, 7.0))
    assert np.abs(one - other).max() < 1e-4


def test_a_quarter_turn_of_the_crop_turns_the_keypoints(tango: BoardModel) -> None:
    proposer = LearnedProposer.prepare(tango, CAMERA)
    assert proposer is not None
    rng = np.random.default_rng(4)
    image = rng.normal(20, 2, (300, 480)).astype(np.float32)
    image[120:190, 200:290] += 60
    region = proposer.propose(image, 2.0, [_region(190, 110, 300, 200)])
    assert region is not None
    again = proposer.infer_again(image, 2.0, region)
    first, second = (g.p @ CENTRES / g.p.sum(axis=-1) for g in (region, again))
    # the mean of four looks stays where the first saw the craft
    assert np.abs(first.mean(axis=0) - second.mean(axis=0)).max() < 0.25


def _region(*box: float):  # type: ignore[no-untyped-def]
    from flyaround.hil.board.svd.region_of_interest import Region

    return Region(*box, "test")


@pytest.mark.parametrize("name", ["tango", "tango-mockup", "dragon", "cubesat-3u"])
def test_shipped_heads_fit_their_craft(name: str) -> None:
    model = board_model(load_target(name))
    network = network_for(model)
    assert network is not None
    assert network.head.trunk_sha256 == trunk_sha256()
    log_p, present, size = network(np.zeros((2, 2, INPUT_PX, INPUT_PX), np.float32))
    assert np.exp(log_p).sum(axis=-1) == pytest.approx(1.0, abs=1e-3)
    assert present.shape == size.shape == (2,)


def test_a_craft_of_another_shape_has_no_network(tango: BoardModel) -> None:
    moved = {name: 1.2 * p for name, p in tango.keypoints.items()}
    assert network_for(replace(tango, keypoints=moved)) is None
    assert network_for(replace(tango, name="../tango")) is None


def head_bytes(**changed: object) -> bytes:
    rng = np.random.default_rng(2)
    weights = {k: rng.normal(0, 0.1, s).astype(np.float32) for k, s in SHAPES.items() if k != "keypoints_m"}
    points = rng.normal(size=SHAPES["keypoints_m"])
    head = KeypointHead("tango", trunk_sha256(), points, weights)
    with np.load(io.BytesIO(head.to_bytes())) as arrays:
        kept = {key: arrays[key] for key in arrays.files}
    out = io.BytesIO()
    np.savez(out, **{key: value for key, value in (kept | changed).items() if value is not None})
    return out.getvalue()


NAN = np.full(SHAPES["maps_bias"], np.nan, np.float16)


def sheet(**calibration: object) -> np.ndarray:
    """Metadata of a head with a calibration."""
    text = json.dumps(
        {
            "schema": "flyaround.keypoint_head",
            "version": 1,
            "craft": "tango",
            "trunk_sha256": trunk_sha256(),
            "calibration": {"weights": [-9.5, *[0.25] * 11], "covariance_factor": 1.5, "frames": 90}
            | calibration,
        }
    )
    return np.frombuffer(text.encode(), np.uint8)


def with_long_header() -> bytes:
    """A head whose array of biases claims to be larger than any memory."""
    header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (9000000000000,), }"
    member = b"\x93NUMPY\x01\x00" + len(header + b"\n").to_bytes(2, "little") + header + b"\n"
    data = io.BytesIO(head_bytes())
    with zipfile.ZipFile(data) as whole:
        members = {name: whole.read(name) for name in whole.namelist()} | {"maps_bias.npy": member}
    changed = io.BytesIO()
    with zipfile.ZipFile(changed, "w") as file:
        for name, content in members.items():
            file.writestr(name, content)
    return changed.getvalue()


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "not an .npz file"),
        (b"PK\x03\x04 nothing", "not an .npz file"),
        (head_bytes(bins=None), "lacks"),
        (head_bytes(sheet=np.frombuffer(b"{}", np.uint8)), "not flyaround.keypoint_head"),
        (head_bytes(sheet=np.frombuffer(b"[1]", np.uint8)), "cannot be used"),
        (head_bytes(hidden=np.zeros((3, 4), np.float16)), "has shape"),
        (head_bytes(maps_bias=NAN), "not finite"),
        (head_bytes(maps=np.zeros((2_000_000,), np.float32)), "unpacks to more"),
        (head_bytes(whole=np.array([None, "x"], object)), "pickle"),
        (with_long_header(), "damaged"),
        (head_bytes(sheet=sheet(weights=[1e4] * 12)), "a weight"),
        (head_bytes(sheet=sheet(weights=[0.0] * 11)), "reshape"),
        (head_bytes(sheet=sheet(weights=[float("nan")] * 12)), "finite"),
        (head_bytes(sheet=sheet(covariance_factor=0.0)), "scales the covariance"),
        (head_bytes(sheet=sheet(frames=1.5)), "whole number"),
        (head_bytes(sheet=sheet(slope=2.0)), "slope"),
    ],
)
def test_a_file_that_is_no_head_is_refused_in_one_sentence(data: bytes, reason: str) -> None:
    with pytest.raises(BoardModelError, match="train wrote") as refusal:
        KeypointHead.read(data, "x.npz")
    assert reason.lower() in str(refusal.value).lower()
    assert "\n" not in str(refusal.value)


def test_a_head_of_another_craft_is_refused(tango: BoardModel) -> None:
    with pytest.raises(BoardModelError, match="another shape"):
        network_for(replace(tango, network=head_bytes()))


def test_a_head_is_written_and_read_back() -> None:
    head = KeypointHead.read(head_bytes(sheet=sheet()), "x.npz")
    again = KeypointHead.read(head.to_bytes(), "x.npz")
    assert again.calibration == head.calibration == Calibration((-9.5, *[0.25] * 11), 1.5, 90)
    features = np.random.default_rng(5).normal(size=(2, 192, 8, 8)).astype(np.float32)
    for one, other in zip(head(features), again(features), strict=True):
        assert np.array_equal(one, other)


def test_single_precision_weights_are_the_same_network():
    onnx = pytest.importorskip("onnx")
    single = in_single_precision(trunk_bytes())
    # OpenCV 4.6 refuses tensors of any other type (10 is half precision)
    assert {tensor.data_type for tensor in onnx.load_from_string(single).graph.initializer} == {1}
    inputs = np.random.default_rng(0).normal(size=(1, 2, INPUT_PX, INPUT_PX)).astype(np.float32)
    outputs = []
    for data in (trunk_bytes(), single):
        net = cv2.dnn.readNetFromONNX(np.frombuffer(data, np.uint8))
        net.setInput(inputs)
        outputs.append(net.forward())
    np.testing.assert_array_equal(*outputs)


@pytest.mark.parametrize("cut", [1, 100, 5_000_000])
def test_cut_weights_are_refused(cut: int):
    with pytest.raises(ValueError, match="not an ONNX file"):
        in_single_precision(trunk_bytes()[:-cut])
