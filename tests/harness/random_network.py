"""A network's file with random weights, made without PyTorch: what a board reads does not depend on what it knows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.hil.board.net.network_camera import NetworkCamera
from flyaround.hil.board.net.network_file import HeldOutErrors, NetworkFile
from flyaround.hil.board.net.residual_network import ARCHITECTURES

if TYPE_CHECKING:
    from pathlib import Path

CAMERA = NetworkCamera(48, 30, 75.0)
CLASSES = 64


def random_weights(seed: int = 0) -> dict[str, np.ndarray]:
    """Return random weights of each layer, by name."""
    rng = np.random.default_rng(seed)
    out = {}
    for name, (shape, _) in ARCHITECTURES["small"].layers(CAMERA.width_px, CAMERA.height_px, CLASSES).items():
        # nearly equal logits: no attitude is likely
        sigma = 0.01 if name == "attitude" else np.sqrt(2 / np.prod(shape[1:]))
        out[name] = rng.normal(0, sigma, shape).astype(np.float32)
        out[f"{name}_bias"] = rng.normal(0, 0.01, shape[0]).astype(np.float32)
    return out


def network_bytes(
    target: tuple[str, str] = ("tango", ""), weights: dict[str, np.ndarray] | None = None
) -> bytes:
    """Return the file."""
    return NetworkFile(
        name="net.npz",
        target=target[0],
        sha256=target[1],
        camera=CAMERA,
        classes=CLASSES,
        log_range_mean=1.5,
        log_range_scale=0.3,
        errors=HeldOutErrors(0.1, 0.01, 0.05),
        architecture="small",
        weights=random_weights() if weights is None else weights,
    ).to_bytes({})


def write_network(path: Path, target: tuple[str, str] = ("tango", ""), *, sure: int | None = None) -> Path:
    """Write one; ``sure``: a class that it is always sure of, at five metres on the boresight."""
    weights = random_weights()
    if sure is not None:
        for name in ("attitude", "attitude_bias", "place", "place_bias"):
            weights[name][:] = 0.0
        weights["attitude_bias"][sure] = 12.0
    path.write_bytes(network_bytes(target, weights))
    return path
