"""A trained network as an ONNX file that OpenCV from 4.6 on runs, with its sheet."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

import numpy as np
from onnx import TensorProto, helper, numpy_helper

from flyaround.hil.board.net.network_file import ATTITUDE, HASH_KEY, INPUT, PLACE, SCHEMA, SHEET_KEY, VERSION

if TYPE_CHECKING:
    from flyaround.hil.board.net.network_camera import NetworkCamera
    from flyaround.hil.board.net.network_file import HeldOutErrors
    from flyaround.hil.train.residual_network import Architecture, Convolution
    from flyaround.simulator.runtime.arrays import FloatArray

# What OpenCV 4.6 reads.
IR_VERSION, OPERATORS_VERSION = 7, 11


def sheet(
    target: tuple[str, str],
    camera: NetworkCamera,
    classes: int,
    log_range: tuple[float, float],
    errors: HeldOutErrors,
    training: dict[str, Any],
) -> dict[str, Any]:
    """What a board must know of the network beside its weights.

    Parameters
    ----------
    target : name and hash. log_range : mean and scale. training : what it was trained on, for people.
    """
    return {
        "schema": SCHEMA,
        "version": VERSION,
        "target": target[0],
        "target_sha256": target[1],
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "f_px": camera.f_px,
        "classes": classes,
        "log_range_mean": log_range[0],
        "log_range_scale": log_range[1],
        "held_out": {
            "turn_rad": errors.turn_rad,
            "across_share": errors.across_share,
            "along_share": errors.along_share,
        },
        "training": training,
    }


def onnx_bytes(network: Architecture, layers: dict[str, FloatArray], about: dict[str, Any]) -> bytes:
    """The file.

    Parameters
    ----------
    layers : weights and shifts, normalisations folded in. about : as of ``sheet``.
    """
    weights = [
        numpy_helper.from_array(np.ascontiguousarray(value, "<f4"), f"{name}.weight")
        for name, value in layers.items()
    ]
    nodes: list[Any] = []

    def node(operator: str, inputs: list[str], output: str, **attributes: Any) -> str:  # noqa: ANN401 - ONNX's
        nodes.append(helper.make_node(operator, inputs, [output], name=output, **attributes))
        return output

    def convolved(c: Convolution, x: str, *, rectified: bool = True) -> str:
        out = node(
            "Conv",
            [x, f"{c.name}.weight", f"{c.name}_bias.weight"],
            f"{c.name}.out",
            kernel_shape=[c.side] * 2,
            strides=[c.stride] * 2,
            pads=[c.padding] * 4,
        )
        return node("Relu", [out], f"{c.name}.relu") if rectified else out

    x = convolved(network.first, INPUT)
    x = node("MaxPool", [x], "pool", kernel_shape=[3, 3], strides=[2, 2], pads=[1] * 4)
    for block in network.residual_blocks():
        y = convolved(block.second, convolved(block.first, x), rectified=False)
        x = x if block.shortcut is None else convolved(block.shortcut, x, rectified=False)
        x = node("Relu", [node("Add", [y, x], f"{block.second.name}.sum")], f"{block.second.name}.relu")
    for head, seen in (
        (PLACE, convolved(network.squeeze, x)),
        (ATTITUDE, node("GlobalMaxPool", [x], "largest")),
    ):
        flat, name = node("Flatten", [seen], f"{head}.features", axis=1), f"{head}.hidden"
        out = node("Gemm", [flat, f"{name}.weight", f"{name}_bias.weight"], f"{name}.out")
        out = node("Relu", [out], f"{name}.relu")
        node("Gemm", [out, f"{head}.weight", f"{head}_bias.weight"], head)
    graph = helper.make_graph(
        nodes,
        "pose",
        [
            helper.make_tensor_value_info(
                INPUT, TensorProto.FLOAT, [1, 1, about["height_px"], about["width_px"]]
            )
        ],
        [
            helper.make_tensor_value_info(PLACE, TensorProto.FLOAT, [1, 3]),
            helper.make_tensor_value_info(ATTITUDE, TensorProto.FLOAT, [1, about["classes"]]),
        ],
        weights,
    )
    model = helper.make_model(
        graph,
        producer_name="flyaround",
        ir_version=IR_VERSION,
        opset_imports=[helper.make_opsetid("", OPERATORS_VERSION)],
    )
    helper.set_model_props(
        model,
        {
            SHEET_KEY: json.dumps(about),
            HASH_KEY: hashlib.sha256(graph.SerializeToString(deterministic=True)).hexdigest(),
        },
    )
    return bytes(model.SerializeToString(deterministic=True))
