"""Weights by name, the layers made of them, and their normalisations folded in for whoever runs them afterwards.

References
----------
He et al. (2015), Delving deep into rectifiers, ICCV (start); Ioffe & Szegedy (2015), Batch normalization, ICML.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch.nn import functional

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray

    Tree = dict[str, torch.Tensor]

# Added to a variance before it divides.
EPSILON = 1e-4


def start_layer(
    weights: dict[str, FloatArray],
    rng: np.random.Generator,
    name: str,
    shape: tuple[int, ...],
    *,
    inputs: int,
    outputs: int,
    gain: float = 2.0,
) -> None:
    """Add a layer's random weights, and scale and shift of the normalisation of its outputs.

    Parameters
    ----------
    shape : of the weights. inputs, outputs : numbers that each output is a sum of, and of outputs.
    """
    weights[name] = rng.normal(0, np.sqrt(gain / inputs), shape)
    weights[f"{name}_scale"], weights[f"{name}_bias"] = np.ones(outputs), np.zeros(outputs)


def normalised(
    weights: Tree, running: Tree | None, seen: Tree, name: str, x: torch.Tensor, *, rectified: bool = True
) -> torch.Tensor:
    """A layer's outputs (B, C, ...) normalised, scaled, shifted, and rectified.

    Parameters
    ----------
    running : means and variances to use instead of the batch's own, or None. seen : receives the batch's.
    """
    if running is None:
        # what a step of a running mean with weight one keeps are the batch's own
        # as wide as the weights: with short products what comes in may be narrower
        mean, var = (torch.zeros_like(weights[f"{name}_bias"]) for _ in range(2))
    else:
        mean, var = running[f"{name}_mean"], running[f"{name}_var"]
    x = functional.batch_norm(
        x,
        mean,
        var,
        weights[f"{name}_scale"],
        weights[f"{name}_bias"],
        training=running is None,
        momentum=1.0,
        eps=EPSILON,
    )
    seen[f"{name}_mean"], seen[f"{name}_var"] = mean, var
    return torch.relu_(x) if rectified else x


def folded_scale_and_bias(weights: dict[str, FloatArray], name: str) -> tuple[FloatArray, FloatArray]:
    """By what a layer's outputs are multiplied, and what is added: its normalisation in one step."""
    scale = weights[f"{name}_scale"] / np.sqrt(weights[f"{name}_var"] + EPSILON)
    return scale, weights[f"{name}_bias"] - weights[f"{name}_mean"] * scale


def in_double(weights: Tree) -> dict[str, FloatArray]:
    """The weights as arrays of double precision."""
    return {k: v.detach().cpu().double().numpy() for k, v in weights.items()}


def trainable(arrays: dict[str, FloatArray]) -> Tree:
    """Weights of single precision that a step may change."""
    return {k: torch.tensor(v, dtype=torch.float32, requires_grad=True) for k, v in arrays.items()}
