"""The learned proposal by the compiled library: what it is shown, its network, and its attitudes are numpy's."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from kernel_oracle import learned as oracle

from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.hybrid.image.edge_field import area_mean
from flyaround.hil.board.hybrid.image.line_segments import lsd_stream
from flyaround.hil.board.hybrid.image.noise import noise_sigma
from flyaround.hil.board.hybrid.propose.learned.attitude_basis import ANCHORS, bumps, turning_bumps
from flyaround.hil.board.hybrid.propose.learned.convolution import Layers, convolutions
from flyaround.hil.board.hybrid.propose.learned.learned_proposal import network_for
from flyaround.hil.board.hybrid.propose.learned.network import INPUT_FILL, INPUT_PX
from flyaround.hil.board.hybrid.propose.learned.network_input import (
    ImageCrop,
    _crop_by_opencv,
    crop_images,
    network_inputs,
)
from flyaround.hil.board.hybrid.propose.learned.view_subspaces import QUARTERS, TURNS, ViewSubspaces
from flyaround.hil.board.svd.line_streams import lsd_lines

CAMERA = CameraIntrinsics(480, 300, 750.0, 740.0, 239.5, 149.5)


def clouds(rng: np.random.Generator) -> np.ndarray:
    """(300, 480) uint8 of all brightnesses."""
    rough = cv2.GaussianBlur(rng.normal(0, 1, (300, 480)), (0, 0), 5.0)
    return np.asarray(
        np.clip(110 + 60 * rough / rough.std() + rng.normal(0, 3, rough.shape), 0, 255), np.uint8
    )


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_area_means_are_opencvs(kind: type) -> None:
    rng = np.random.default_rng(1)
    picture = rng.uniform(0, 255, (211, 340)).astype(kind)
    sizes = (
        (85, 53, 0, 0),
        (340, 211, 0, 0),
        (100, 99, 3, 7),
        (8, 8, 300, 190),
        (20, 8, 320, 200),
        (60, 52, 100, 3),
    )
    for width, height, x, y in sizes:
        part = picture[y:, x:]
        exact = cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA).astype(float)
        off = np.abs(area_mean(part, width, height) - exact)
        # whole numbers are rounded: a half may fall to either side
        assert np.quantile(off, 0.995) < 1e-4
        assert off.max() < (1e-4 if kind is np.float32 else 1.01)
    # what the library does not read is reduced all the same: columns apart, and as many rows as there are not
    assert area_mean(picture[:, ::2], 40, 30).shape == (30, 40)
    assert area_mean(picture[:5], 40, 8).shape == (8, 40)


def test_looks_are_numpys_wherever_they_are_at() -> None:
    rng = np.random.default_rng(2)
    picture = clouds(rng)
    reduced = area_mean(picture, 120, 75)
    crops = [
        ImageCrop.at(CAMERA, rng.uniform(-200, 700), rng.uniform(-100, 400), size)
        for size in (12.0, 40.0, 120.0, 400.0, 2000.0)
        for _ in range(3)
    ]
    args = [
        (p, 2.0, CAMERA, crops, r) for p in (picture, 7 * picture.astype(np.uint16)) for r in (None, reduced)
    ]
    for given in args:
        image, *_, r = given
        one, seen = network_inputs(*given), crop_images(image, CAMERA, crops, 31, 20.0, r)
        expected = np.stack([_crop_by_opencv(image, CAMERA, g, 31, 20.0, r) for g in crops])
        sphere = INPUT_FILL * INPUT_PX
        shown = np.stack([_crop_by_opencv(image, CAMERA, g, INPUT_PX, sphere, r) for g in crops])
        other = oracle.contrast(shown, np.array([2.0 / max(g.diameter_px / sphere, 1.0) for g in crops]))
        # older OpenCV inputs between pixels in 32 steps, and of whole numbers a half may be rounded to either side
        fine = 2e-4 if cv2.__version__ >= "5" else 2e-2
        for a, b, unit in ((one, other, 1.0), (seen, expected, float(expected.max()))):
            off = np.abs(a - b) / unit
            assert np.quantile(off, 0.999) < fine
            assert off.max() < 2e-2
        assert np.ptp(one) > 2


def test_the_network_is_numpys_to_what_its_weights_leave_out(
    tango: BoardModel,
) -> None:
    net, rng = network_for(tango), np.random.default_rng(3)
    assert net is not None
    crops = [ImageCrop.at(CAMERA, *rng.uniform(60, 240, 2), rng.uniform(40, 200)) for _ in range(7)]
    inputs = network_inputs(clouds(rng), 2.0, CAMERA, crops)
    said = net(inputs)
    broken = net(
        np.concatenate([inputs[:1], np.full_like(inputs[:1], np.nan), 1e38 * inputs[:1], inputs[1:2]])
    )
    for one, other in zip(said, oracle.network(net, inputs), strict=True):
        # its file has weights of 11 bits
        np.testing.assert_allclose(one, other, atol=2e-3 * float(np.abs(other).max()))
    for one, other in zip(said, broken, strict=True):
        # one look harms no other
        np.testing.assert_allclose(one[:2], other[[0, 3]], atol=1e-4)


def test_a_layer_of_whole_numbers_is_exact() -> None:
    rng = np.random.default_rng(4)
    for taps, stride, channels, out in ((5, 2, 2, 24), (3, 2, 6, 16), (3, 1, 4, 37), (3, 2, 10, 128)):
        kernel, bias = rng.integers(-90, 90, (taps, taps, channels, out)), rng.integers(-500, 500, out)
        inputs = rng.integers(-900, 900, (2, 8, 8, channels)).astype(np.float32)
        # the largest there may be: a unit of each is worth one
        kernel[0, 0, 0], inputs[:, 0, 0, 0] = 32767, 4095
        layers = Layers.of([kernel], [bias], [stride])
        exact = np.maximum(oracle.convolve(inputs, kernel.astype(np.float32), stride) + bias, 0)
        made = convolutions(inputs, layers)
        np.testing.assert_allclose(made, exact, rtol=1e-6, atol=1e-6 * exact.max())
        with pytest.raises(ValueError, match="channels"):
            convolutions(np.zeros((1, 8, 8, channels + 2), np.float32), layers)
    with pytest.raises(ValueError, match="odd number"):
        Layers.of([np.zeros((3, 3, 3, 8))], [np.zeros(8)], [1])


def test_likelihoods_are_the_sum_of_all_bumps(views: ViewSubspaces) -> None:
    said = np.random.default_rng(5).normal(0, 4, (2, QUARTERS, ANCHORS)).astype(np.float32)
    likely = views.likelihoods(said)
    some = np.random.default_rng(6).integers(0, len(views.size), 12)
    each = np.einsum("vtj,nkj->nvtk", bumps(views.q).reshape(-1, TURNS, ANCHORS)[some], said)
    turned = [np.roll(each[..., k], k * TURNS // QUARTERS, axis=2) for k in range(QUARTERS)]
    exact = np.mean(turned, axis=0)
    assert np.ptp(exact) > 5
    np.testing.assert_allclose(likely.reshape(2, -1, TURNS)[:, some], exact, atol=2e-5)
    np.testing.assert_allclose(turning_bumps(views.q[::TURNS]), views.bumps, atol=1e-6)


def test_noise_is_the_same_without_a_library(request: pytest.FixtureRequest) -> None:
    rng = np.random.default_rng(8)
    dark = np.clip(rng.normal(0, 3, (301, 400)), 0, 255).astype(np.uint8)
    pictures = [clouds(rng), clouds(rng)[:, 7:], dark, np.full((64, 64), 255, np.uint8), dark[:3, :3]]
    ours = [noise_sigma(p, 255.0) for p in pictures]
    request.getfixturevalue("no_library")
    assert ours == [noise_sigma(p, 255.0) for p in pictures]
    assert ours[0] == pytest.approx(3.0, abs=0.3)


def test_straight_segments_are_opencvs() -> None:
    if not hasattr(cv2, "createLineSegmentDetector"):
        pytest.skip("this OpenCV has no line segment detector")
    rng = np.random.default_rng(9)
    picture = clouds(rng)
    for _ in range(12):
        ends = rng.uniform(20, 280, (4, 2)).astype(np.int32)
        cv2.fillConvexPoly(picture, cv2.convexHull(ends), float(rng.uniform(0, 255)), cv2.LINE_AA)
    ours = lsd_stream(picture.astype(np.float32), 5.0)
    # a thin line has two sides
    assert len(lsd_stream(np.eye(12, dtype=np.float32), 5.0)) == 2
    assert len(lsd_stream(np.zeros((9, 9), np.float32), 5.0)) == 0
    theirs = lsd_lines(picture.astype(np.float32), 5.0)
    assert len(theirs) > 50
    # where edges are equally strong, theirs are begun with in any order
    off = np.abs(ours[:, None] - theirs[None]).max(axis=2).min(axis=1)
    assert (off < 0.2).mean() > 0.95
    assert abs(len(ours) - len(theirs)) < 0.03 * len(theirs)
