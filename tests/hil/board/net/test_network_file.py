"""A network's file: what OpenCV makes of it, and what is refused before OpenCV is given it."""

import hashlib
import json
import os
import random

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper
from random_network import CAMERA, CLASSES, TINY, layers, network_bytes, write_network

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.net import network_file
from flyaround.hil.board.net.network_file import HASH_KEY, SHEET_KEY, NetworkFile


def relu(x):
    return np.maximum(x, 0.0)


def convolve(x, w, bias, stride):
    """The definition, for (C, H, W)."""
    k, pad = w.shape[2], w.shape[2] // 2
    p = np.pad(x, ((0, 0), (pad, pad), (pad, pad)))
    windows = np.lib.stride_tricks.sliding_window_view(p, (k, k), axis=(1, 2))[:, ::stride, ::stride]
    return np.einsum("chwij,ocij->ohw", windows, w) + bias[:, None, None]


def by_definition(w, picture):
    def conv(c, x):
        return convolve(x, w[c.name], w[f"{c.name}_bias"], c.stride)

    x = relu(conv(TINY.first, picture[None]))
    p = np.pad(x, ((0, 0), (1, 1), (1, 1)), constant_values=-np.inf)
    x = np.lib.stride_tricks.sliding_window_view(p, (3, 3), axis=(1, 2))[:, ::2, ::2].max(axis=(3, 4))
    for b in TINY.residual_blocks():
        y = conv(b.second, relu(conv(b.first, x)))
        x = relu(y + (x if b.shortcut is None else conv(b.shortcut, x)))

    def told(head, x):
        return relu(x @ w[f"{head}.hidden"] + w[f"{head}.hidden_bias"]) @ w[head] + w[f"{head}_bias"]

    return told("place", relu(conv(TINY.squeeze, x)).reshape(-1)), told("attitude", x.max(axis=(1, 2)))


def test_opencv_computes_what_the_definition_says(tmp_path):
    file = NetworkFile.read(write_network(tmp_path / "net.onnx"))
    assert (file.target, file.classes, file.camera) == ("tango", CLASSES, CAMERA)
    picture = np.random.default_rng(1).normal(size=(30, 48)).astype(np.float32)
    place, attitude = file.run(file.open(), picture)
    expected = by_definition(layers(), picture)
    np.testing.assert_allclose(place, expected[0], atol=1e-4 * np.abs(expected[0]).max())
    np.testing.assert_allclose(attitude, expected[1], atol=1e-4 * np.abs(expected[1]).max())
    onnx.checker.check_model(onnx.load_from_string(network_bytes()), full_check=True)


def refusal(tmp_path, data):
    path = tmp_path / "bad.onnx"
    path.write_bytes(data)
    with pytest.raises(BoardModelError) as caught:
        NetworkFile.read(path).open()
    sentence = str(caught.value)
    assert "bad.onnx" in sentence
    assert "\n" not in sentence
    return sentence


def changed(change, sheet_change=lambda _sheet: None):
    """The file after a change of its graph, its hash made right again as who means harm would."""
    model = onnx.load_from_string(network_bytes())
    change(model.graph)
    properties = {p.key: p.value for p in model.metadata_props}
    sheet = json.loads(properties[SHEET_KEY])
    sheet_change(sheet)
    digest = hashlib.sha256(model.graph.SerializeToString(deterministic=True)).hexdigest()
    helper.set_model_props(model, {SHEET_KEY: json.dumps(sheet), HASH_KEY: digest})
    return model.SerializeToString(deterministic=True)


def add_node(operator, **attributes):
    def change(graph):
        graph.node.append(helper.make_node(operator, ["place"], ["more"], **attributes))

    return change


def external(graph):
    weights = graph.initializer[0]
    weights.ClearField("raw_data")
    weights.data_location = TensorProto.EXTERNAL
    weights.external_data.add(key="location", value="/etc/passwd")


def input_side(graph):
    graph.input[0].type.tensor_type.shape.dim[2].dim_value = 10**9


def unnamed_side(graph):
    graph.input[0].type.tensor_type.shape.dim[2].dim_param = "any"


def second_input(graph):
    graph.input.append(helper.make_tensor_value_info("more", TensorProto.FLOAT, [1, 3]))


def other_output(graph):
    graph.output[1].type.tensor_type.shape.dim[1].dim_value = CLASSES + 1


def huge_stride(graph):
    next(a for a in graph.node[0].attribute if a.name == "strides").ints[0] = 10**6


def no_stride(graph):
    next(a for a in graph.node[0].attribute if a.name == "strides").ints[0] = 0


def lying_shape(graph):
    graph.initializer[0].dims[0] = 10**9


def not_finite(graph):
    data = np.frombuffer(graph.initializer[0].raw_data, "<f4").copy()
    data[3] = np.nan
    graph.initializer[0].raw_data = data.tobytes()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (add_node("Loop"), "'Loop'"),
        (add_node("Relu", domain="mine"), "'Relu'"),
        (add_node("Flatten", inner=helper.make_graph([], "inner", [], [])), "a graph"),
        (external, "another file"),
        (input_side, "inputs"),
        (unnamed_side, "inputs"),
        (second_input, "inputs"),
        (other_output, "outputs"),
        (huge_stride, "1000000"),
        (no_stride, "strides"),
        (lying_shape, "bytes"),
        (not_finite, "finite"),
        (lambda graph: graph.node.pop(), "OpenCV"),
        (lambda graph: [graph.node.append(graph.node[0]) for _ in range(2500)], "nodes"),
    ],
)
def test_another_graph_than_ours_is_refused_in_a_sentence(tmp_path, change, says):
    assert says in refusal(tmp_path, changed(change))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("width_px", 10**9),
        ("classes", 5),
        ("classes", True),
        ("f_px", float("nan")),
        ("log_range_mean", 1e9),
        ("target", 3),
        ("target", "x" * 300),
        ("held_out", []),
        ("held_out", {"turn_rad": 0.0}),
        ("version", 2),
    ],
)
def test_a_sheet_with_a_wrong_field_is_refused_in_a_sentence(tmp_path, key, value):
    refusal(tmp_path, changed(lambda _graph: None, lambda sheet: sheet.update({key: value})))


def test_no_file_a_pipe_another_file_and_a_large_one_are_refused(tmp_path, monkeypatch):
    for path in (tmp_path / "none.onnx", tmp_path, "a\0b"):
        with pytest.raises(BoardModelError, match="cannot be read"):
            NetworkFile.read(path)
    os.mkfifo(tmp_path / "pipe.onnx")
    with pytest.raises(BoardModelError, match="no regular file"):
        NetworkFile.read(tmp_path / "pipe.onnx")
    refusal(tmp_path, b"")
    refusal(tmp_path, b"\x89PNG\r\n\x1a\n" + bytes(100))
    monkeypatch.setattr(network_file, "MOST_BYTES", 1000)
    refusal(tmp_path, network_bytes())


def test_damage_anywhere_is_refused_or_changes_nothing(tmp_path):
    rng = random.Random(3)
    whole = network_bytes()
    start = len(whole)
    path = tmp_path / "bad.onnx"
    for _ in range(400):
        data = bytearray(whole)
        kind = rng.randrange(3)
        if kind == 0:
            data[rng.randrange(start)] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del data[rng.randrange(start) :]
        else:
            at = rng.randrange(start)
            data[at:at] = bytes(rng.randrange(256) for _ in range(rng.randrange(1, 9)))
        path.write_bytes(bytes(data))
        try:
            file = NetworkFile.read(path)
        except BoardModelError as error:
            assert "\n" not in str(error)  # noqa: PT017 - most of them are refused, some change nothing
            continue
        # what is left is damage of what nobody reads
        assert file.classes == CLASSES
