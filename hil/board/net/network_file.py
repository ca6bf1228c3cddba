"""A network's file, read as one that anybody may have written: what is in it is checked before OpenCV is given it.

ONNX (https://onnx.ai/onnx/repo-docs/IR.html) with one picture in, place and attitude out, and the sheet in its
metadata: which target, which camera, how well it did on pictures that were held out.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Tuple, Union

import cv2
import numpy as np

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.files import read_bounded
from flyaround.hil.board.net import wire
from flyaround.hil.board.net.network_camera import NetworkCamera

Array = np.ndarray

SCHEMA, VERSION = "flyaround.network", 1
SHEET_KEY, HASH_KEY = "flyaround", "flyaround.graph_sha256"
INPUT, PLACE, ATTITUDE = "image", "place", "attitude"

MOST_BYTES, MOST_SHEET_BYTES = 256_000_000, 64_000
SIDE_PX, CLASSES = (16, 1024), (8, 20_000)

# What a residual network is made of; no loop, no other graph, no file beside it.
OPERATORS = ("Add", "Conv", "Flatten", "Gemm", "GlobalMaxPool", "MaxPool", "Relu")
MOST_NODES, MOST_ATTRIBUTE = 2000, 64
FLOAT = 1


@dataclass(frozen=True)
class HeldOutErrors:
    """RMS errors on pictures that the training did not see: about each axis, and over the range."""

    turn_rad: float
    across_share: float
    along_share: float


@dataclass(frozen=True, eq=False)
class NetworkFile:
    """A network and its sheet.

    Parameters
    ----------
    name : of the file. target, sha256 : of the craft that it was trained on. camera : that its pictures are taken by.
    classes : attitudes that it tells apart.
    log_range_mean, log_range_scale : of the logarithm of the range [m], which its third number is in units of.
    errors : of its answers that are accepted. model : the whole file.
    """

    name: str
    target: str
    sha256: str
    camera: NetworkCamera
    classes: int
    log_range_mean: float
    log_range_scale: float
    errors: HeldOutErrors
    model: bytes

    @staticmethod
    def read(path: Union[str, Path]) -> NetworkFile:
        """Read and check a file that ``flyaround train`` wrote.

        Raises
        ------
        BoardModelError
            If it cannot be read, or is no such network: one sentence.
        """
        try:
            data = read_bounded(path, MOST_BYTES)
        except OSError as error:
            raise BoardModelError(
                f"network {path} cannot be read: {error.strerror or error}; name a file that flyaround train wrote"
            ) from error
        except ValueError as error:
            raise BoardModelError(f"network {path!r} cannot be read: {error}") from error
        try:
            return _parsed(Path(path).name, data)
        except (ValueError, KeyError, TypeError, RecursionError, OverflowError) as error:
            said = f"its sheet lacks {error}" if isinstance(error, KeyError) else str(error)
            raise BoardModelError(
                f"network {path} cannot be used: {said}; name a file that flyaround train wrote"
            ) from error

    def open(self) -> cv2.dnn.Net:
        """The network as OpenCV runs it.

        Raises
        ------
        BoardModelError
            If OpenCV cannot, or its outputs are of another shape than the file says.
        """
        try:
            net = cv2.dnn.readNetFromONNX(np.frombuffer(self.model, np.uint8))
            self.run(net, np.zeros((self.camera.height_px, self.camera.width_px), np.float32))
        except (cv2.error, ValueError) as error:
            lines = str(error).strip().splitlines() or ["no reason given"]
            raise BoardModelError(
                f"network {self.name}: OpenCV {cv2.__version__} cannot run it ({lines[-1][:200]}); train it anew"
            ) from error
        return net

    def run(self, net: cv2.dnn.Net, picture: Array) -> Tuple[Array, Array]:
        """Place (3,) and logits of the attitudes (K,) of one (h, w) float32 picture.

        Raises
        ------
        ValueError
            If what comes out is of another shape.
        """
        net.setInput(picture[None, None])
        # OpenCV names outputs as each of its versions likes; there are more classes than numbers of a place
        outs = [np.asarray(out, float).reshape(-1) for out in net.forward(net.getUnconnectedOutLayersNames())]
        outs.sort(key=len)
        if [len(out) for out in outs] != [3, self.classes]:
            raise ValueError(f"it gives {[len(out) for out in outs]} numbers instead of 3 and {self.classes}")
        return outs[0], outs[1]


def _parsed(name: str, data: bytes) -> NetworkFile:
    model = wire.fields(memoryview(data))
    metadata = _metadata(model)
    if SHEET_KEY not in metadata:
        raise ValueError("it has no sheet of ours")
    graph = wire.message(model.get(7, []))
    if hashlib.sha256(graph).hexdigest() != metadata.get(HASH_KEY):
        raise ValueError("its graph is not the one that was written")
    sheet = json.loads(metadata[SHEET_KEY])
    if not isinstance(sheet, dict) or sheet.get("schema") != SCHEMA or sheet.get("version") != VERSION:
        raise ValueError(f"its sheet is not of schema {SCHEMA}, version {VERSION}")
    camera = NetworkCamera(
        _whole(sheet, "width_px", *SIDE_PX),
        _whole(sheet, "height_px", *SIDE_PX),
        _real(sheet, "f_px", 1.0, 1e5),
    )
    classes = _whole(sheet, "classes", *CLASSES)
    _check_graph(graph, camera, classes)
    errors = sheet["held_out"]
    return NetworkFile(
        name=name,
        target=_text(sheet, "target"),
        sha256=_text(sheet, "target_sha256"),
        camera=camera,
        classes=classes,
        log_range_mean=_real(sheet, "log_range_mean", -20.0, 20.0),
        log_range_scale=_real(sheet, "log_range_scale", 1e-3, 20.0),
        errors=HeldOutErrors(
            _real(errors, "turn_rad", 1e-6, 10.0),
            _real(errors, "across_share", 1e-6, 100.0),
            _real(errors, "along_share", 1e-6, 100.0),
        ),
        model=data,
    )


def _metadata(model: Dict[int, List[wire.Value]]) -> Dict[str, str]:
    found = {}
    for value in model.get(14, []):
        pair = wire.fields(wire.message([value]))
        if len(wire.message(pair.get(2, [memoryview(b"")]))) <= MOST_SHEET_BYTES:
            found[wire.text(pair.get(1, []))] = wire.text(pair.get(2, []))
    return found


def _check_graph(data: memoryview, camera: NetworkCamera, classes: int) -> None:
    """Refuse a graph with other inputs, outputs or operators than ours have."""
    graph = wire.fields(data)
    _check_shapes(graph.get(11, []), {INPUT: [1, 1, camera.height_px, camera.width_px]}, "inputs")
    _check_shapes(graph.get(12, []), {PLACE: [1, 3], ATTITUDE: [1, classes]}, "outputs")
    if graph.get(15):
        raise ValueError("its weights are sparse, which ours are not")
    nodes = graph.get(1, [])
    if not 1 <= len(nodes) <= MOST_NODES:
        raise ValueError(f"its graph has {len(nodes)} nodes, allowed: 1 to {MOST_NODES}")
    for value in nodes:
        node = wire.fields(wire.message([value]))
        operator = wire.text(node.get(4, []))
        if operator not in OPERATORS or wire.text(node.get(7, [])):
            raise ValueError(f"it has an operator {operator[:40]!r}, allowed: {', '.join(OPERATORS)}")
        for attribute in node.get(5, []):
            _check_attribute(operator, wire.fields(wire.message([attribute])))
    for value in graph.get(5, []):
        _check_weights(wire.fields(wire.message([value])))


def _check_attribute(operator: str, attribute: Dict[int, List[wire.Value]]) -> None:
    if set(attribute) & {5, 6, 10, 11}:
        raise ValueError(f"an operator {operator} holds a graph or weights of its own")
    name = wire.text(attribute.get(1, []))
    least = 1 if name in ("strides", "kernel_shape", "dilations", "group") else 0
    # a number that stands for nothing is left out
    given = wire.numbers([*attribute.get(3, []), *attribute.get(8, [])])
    if not all(least <= n <= MOST_ATTRIBUTE for n in given):
        raise ValueError(
            f"an operator {operator} has {name[:40]} {given[:8]}, allowed: {least} to {MOST_ATTRIBUTE}"
        )


def _check_weights(tensor: Dict[int, List[wire.Value]]) -> None:
    if tensor.get(13) or wire.number(tensor.get(14, [])) != 0:
        raise ValueError("its weights lie in another file")
    if wire.number(tensor.get(2, [])) != FLOAT:
        raise ValueError("its weights are not of 32 bits")
    shape = wire.numbers(tensor.get(1, []))
    if not 1 <= len(shape) <= 4 or min(shape) < 1:
        raise ValueError(f"it has weights of shape {shape[:8]}")
    raw = wire.message(tensor.get(9, []))
    if len(raw) != 4 * math.prod(shape):
        raise ValueError(f"its weights of shape {shape} have {len(raw)} bytes")
    if not np.isfinite(np.frombuffer(raw, "<f4")).all():
        raise ValueError("a weight is not finite")


def _check_shapes(values: List[wire.Value], wanted: Dict[str, List[int]], what: str) -> None:
    found = {}
    for value in values:
        entry = wire.fields(wire.message([value]))
        tensor = wire.fields(wire.message(wire.fields(wire.message(entry.get(2, []))).get(1, [])))
        if wire.number(tensor.get(1, [])) != FLOAT:
            raise ValueError(f"its {what} are not of 32 bits")
        sides = wire.fields(wire.message(tensor.get(2, []))).get(1, [])
        # a side without a number may be of any size
        found[wire.text(entry.get(1, []))] = [
            wire.number(wire.fields(wire.message([side])).get(1, []), -1) for side in sides
        ]
    if found != wanted:
        said = ", ".join(f"{name[:40]} {shape}" for name, shape in list(found.items())[:4]) or "none"
        ours = ", ".join(f"{name} {shape}" for name, shape in wanted.items())
        raise ValueError(f"its {what} are {said}, and should be {ours}")


def _whole(sheet: Dict[str, Any], key: str, low: int, high: int) -> int:
    value = sheet[key]
    if type(value) is not int or not low <= value <= high:
        raise ValueError(f"its {key} is {str(value)[:40]}, allowed: {low} to {high}")
    return value


def _real(sheet: Dict[str, Any], key: str, low: float, high: float) -> float:
    value = sheet[key]
    if type(value) not in (int, float) or not low <= value <= high:
        raise ValueError(f"its {key} is {str(value)[:40]}, allowed: {low:g} to {high:g}")
    return float(value)


def _text(sheet: Dict[str, Any], key: str) -> str:
    value = sheet[key]
    if not isinstance(value, str) or len(value) > 200:
        raise ValueError(f"its {key} is no short text")
    return value
