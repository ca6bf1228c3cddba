"""A network's file with random weights, made without PyTorch: what a board reads does not depend on what it knows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.hil.board.net.network_camera import NetworkCamera
from flyaround.hil.board.net.network_file import HeldOutErrors
from flyaround.hil.train.onnx_file import onnx_bytes, sheet
from flyaround.hil.train.residual_network import Architecture

if TYPE_CHECKING:
    from pathlib import Path

TINY = Architecture(stem=4, stages=(4, 8), blocks=1, squeezed=4, hidden=8)
CAMERA = NetworkCamera(48, 30, 75.0)
CLASSES = 64


def layers(seed: int = 0, camera: NetworkCamera = CAMERA) -> dict[str, np.ndarray]:
    """Random weights and shifts of each layer, by name."""
    rng = np.random.default_rng(seed)
    out = {}
    for c in TINY.convolutions():
        out[c.name] = rng.normal(0, 0.3, (c.outputs, c.inputs, c.side, c.side))
        out[f"{c.name}_bias"] = rng.normal(0, 0.1, c.outputs)
    features = TINY.features(camera.width_px, camera.height_px)
    for name, inputs, outputs in (
        ("place.hidden", features, 8),
        ("attitude.hidden", TINY.stages[-1], 8),
        ("place", 8, 3),
        ("attitude", 8, CLASSES),
    ):
        out[name] = rng.normal(0, 0.3, (inputs, outputs))
        out[f"{name}_bias"] = rng.normal(0, 0.1, outputs)
    return out


def network_bytes(
    target: tuple[str, str] = ("tango", ""), weights: dict[str, np.ndarray] | None = None
) -> bytes:
    """The file."""
    about = sheet(target, CAMERA, CLASSES, (1.5, 0.3), HeldOutErrors(0.1, 0.01, 0.05), {})
    return onnx_bytes(TINY, layers() if weights is None else weights, about)


def write_network(path: Path, target: tuple[str, str] = ("tango", ""), *, sure: int | None = None) -> Path:
    """Write one; ``sure``: a class that it is always sure of, at five metres on the boresight."""
    weights = layers()
    if sure is not None:
        weights["attitude"][:], weights["place"][:], weights["place_bias"][:] = 0.0, 0.0, 0.0
        weights["attitude_bias"][:] = 0.0
        weights["attitude_bias"][sure] = 12.0
    path.write_bytes(network_bytes(target, weights))
    return path
