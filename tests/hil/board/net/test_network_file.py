"""A network's file: what a board computes with it, and what is refused."""

import io
import json
import os
import random
import zipfile

import cv2
import numpy as np
import pytest
from random_network import CAMERA, CLASSES, network_bytes, random_weights, write_network

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.net import network_file
from flyaround.hil.board.net.network_file import NetworkFile
from flyaround.hil.board.net.residual_network import convolve


@pytest.mark.parametrize(("side", "stride"), [(1, 1), (3, 1), (3, 2), (7, 2)])
def test_a_convolution_is_what_opencv_filters(side, stride):
    rng = np.random.default_rng(2)
    x, weight = rng.normal(size=(3, 9, 12)), rng.normal(size=(2, 3, side, side))
    bias = rng.normal(size=2)
    for got, kernels, shift in zip(convolve(x, weight, bias, stride), weight, bias, strict=True):
        layers = zip(x, kernels, strict=True)
        whole = sum(cv2.filter2D(m, -1, k, borderType=cv2.BORDER_CONSTANT) for m, k in layers)
        np.testing.assert_allclose(got, whole[::stride, ::stride] + shift, atol=1e-9)


def test_a_file_is_read_as_it_was_written(tmp_path):
    file = NetworkFile.read(write_network(tmp_path / "net.npz"))
    assert (file.name, file.target, file.classes, file.camera) == ("net.npz", "tango", CLASSES, CAMERA)
    assert all(np.array_equal(value, file.weights[name]) for name, value in random_weights().items())
    place, attitude = file.run(np.random.default_rng(1).normal(size=(30, 48)).astype(np.float32))
    assert (place.shape, attitude.shape) == ((3,), (CLASSES,))


def refusal(tmp_path, data):
    path = tmp_path / "bad.npz"
    path.write_bytes(data)
    with pytest.raises(BoardModelError) as caught:
        NetworkFile.read(path)
    sentence = str(caught.value)
    assert "bad.npz" in sentence
    assert "\n" not in sentence
    return sentence


def changed(arrays_change=lambda _arrays: None, sheet_change=lambda _sheet: None):
    """The file after a change of its arrays or sheet."""
    with np.load(io.BytesIO(network_bytes())) as file:
        arrays = dict(file)
    sheet = json.loads(arrays["sheet"].tobytes())
    sheet_change(sheet)
    arrays["sheet"] = np.frombuffer(json.dumps(sheet).encode(), np.uint8)
    arrays_change(arrays)
    data = io.BytesIO()
    np.savez_compressed(data, **arrays)
    return data.getvalue()


def not_finite(arrays):
    arrays["squeeze"][0, 3] = np.nan


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (not_finite, "finite"),
        (lambda arrays: arrays.pop("place_bias"), "place_bias"),
        (lambda arrays: arrays.pop("sheet"), "sheet"),
        (lambda arrays: arrays.update(sheet=np.array(["{}"])), "cannot be used"),
        (lambda arrays: arrays.update(stem=arrays["stem"].astype(np.float64)), "float64"),
        (lambda arrays: arrays.update(stem=arrays["stem"][:-1]), "shape"),
        (lambda arrays: arrays.update(attitude=np.zeros((CLASSES + 1, 256), np.float32)), "attitude"),
        (lambda arrays: arrays.update(stem=np.array([None], object)), "cannot be used"),
    ],
)
def test_other_weights_are_refused_in_a_sentence(tmp_path, change, says):
    assert says in refusal(tmp_path, changed(change))


def test_a_small_file_that_unpacks_to_a_large_one_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(network_file, "MAX_BYTES", 4_000_000)
    data = changed(lambda arrays: arrays.update(more=np.zeros(1_000_000, np.float32)))
    assert len(data) < 4_000_000
    assert "unpacks" in refusal(tmp_path, data)


def test_a_header_that_promises_more_than_there_is_is_refused(tmp_path):
    header = io.BytesIO()
    described = {"descr": "<f4", "fortran_order": False, "shape": (10**14,)}
    np.lib.format.write_array_header_1_0(header, described)
    data = io.BytesIO(network_bytes())
    with zipfile.ZipFile(data, "a") as members:
        members.writestr("more.npy", header.getvalue())
    refusal(tmp_path, data.getvalue())


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("width_px", 10**9),
        ("width_px", 90),
        ("classes", 5),
        ("classes", True),
        ("f_px", float("nan")),
        ("log_range_mean", 1e9),
        ("architecture", "huge"),
        ("architecture", "resnet18"),
        ("target", 3),
        ("target", "x" * 300),
        ("held_out", []),
        ("held_out", {"turn_rad": 0.0}),
        ("version", 1),
    ],
)
def test_a_sheet_with_a_wrong_field_is_refused_in_a_sentence(tmp_path, key, value):
    refusal(tmp_path, changed(sheet_change=lambda sheet: sheet.update({key: value})))


def test_no_file_a_pipe_another_file_and_a_large_one_are_refused(tmp_path, monkeypatch):
    for path in (tmp_path / "none.npz", tmp_path, "a\0b"):
        with pytest.raises(BoardModelError, match="cannot be read"):
            NetworkFile.read(path)
    os.mkfifo(tmp_path / "pipe.npz")
    with pytest.raises(BoardModelError, match="not a regular file"):
        NetworkFile.read(tmp_path / "pipe.npz")
    refusal(tmp_path, b"")
    refusal(tmp_path, b"\x89PNG\r\n\x1a\n" + bytes(100))
    monkeypatch.setattr(network_file, "MAX_BYTES", 1000)
    refusal(tmp_path, network_bytes())


def test_damage_anywhere_is_refused_or_changes_nothing(tmp_path):
    rng = random.Random(3)
    whole, weights = network_bytes(), random_weights()
    # one in three at the end, which says where each array lies
    places = (len(whole), len(whole), 4000)
    path = tmp_path / "bad.npz"
    for k in range(400):
        data = bytearray(whole)
        at = len(whole) - 1 - rng.randrange(places[k % 3])
        kind = rng.randrange(3)
        if kind == 0:
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del data[at:]
        else:
            data[at:at] = bytes(rng.randrange(256) for _ in range(rng.randrange(1, 9)))
        path.write_bytes(bytes(data))
        try:
            file = NetworkFile.read(path)
        except BoardModelError as error:
            assert "\n" not in str(error)  # noqa: PT017 - most of them are refused, some change nothing
            continue
        # what is left is damage of what nobody reads
        assert all(np.array_equal(value, file.weights[name]) for name, value in weights.items())
