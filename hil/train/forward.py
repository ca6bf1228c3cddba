"""The residual network in PyTorch, and its layers with their normalisations folded in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch.nn import functional

from flyaround.hil.train.layers import folded_scale_and_bias, in_double, normalised

if TYPE_CHECKING:
    from flyaround.hil.train.layers import Tree
    from flyaround.hil.train.residual_network import Architecture, Convolution
    from flyaround.simulator.runtime.arrays import FloatArray


def forward(
    network: Architecture, weights: Tree, running: Tree | None, pictures: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor, Tree]:
    """Place (B, 3), logits of attitudes (B, K), and each layer's mean and variance in this batch.

    Parameters
    ----------
    running : means and variances to use instead of the batch's own, or None. pictures : (B, h, w), standardised.
    """
    seen: Tree = {}

    def convolved(c: Convolution, x: torch.Tensor, *, rectified: bool = True) -> torch.Tensor:
        x = functional.conv2d(x, weights[c.name], stride=c.stride, padding=c.padding)
        return normalised(weights, running, seen, c.name, x, rectified=rectified)

    x = convolved(network.first, pictures[:, None])
    x = functional.max_pool2d(x, 3, stride=2, padding=1)
    for block in network.residual_blocks():
        y = convolved(block.second, convolved(block.first, x), rectified=False)
        x = torch.relu(y + (x if block.shortcut is None else convolved(block.shortcut, x, rectified=False)))

    def told(head: str, x: torch.Tensor) -> torch.Tensor:
        name = f"{head}.hidden"
        x = normalised(weights, running, seen, name, x @ weights[name])
        return x @ weights[head] + weights[f"{head}_bias"]

    place = told("place", convolved(network.squeeze, x).flatten(1))
    return place, told("attitude", x.amax(dim=(2, 3))), seen


def folded(network: Architecture, means: Tree) -> dict[str, FloatArray]:
    """Weights and shifts of each layer, ``NAME`` and ``NAME_bias``, normalisations multiplied in."""
    w = in_double(means)
    out = {k: w[k] for k in ("place", "place_bias", "attitude", "attitude_bias")}
    for c in network.convolutions():
        scale, out[f"{c.name}_bias"] = folded_scale_and_bias(w, c.name)
        out[c.name] = w[c.name] * scale[:, None, None, None]
    for name in ("place.hidden", "attitude.hidden"):
        scale, out[f"{name}_bias"] = folded_scale_and_bias(w, name)
        out[name] = w[name] * scale
    return out
