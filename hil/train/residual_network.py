"""Residual pose network in PyTorch, for training; a board evaluates the exported weights in NumPy."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import nn
from torch.nn import functional
from torch.nn.utils.fusion import fuse_conv_bn_eval, fuse_linear_bn_eval

if TYPE_CHECKING:
    from torch import Tensor

    from flyaround.hil.board.net.residual_network import Architecture
    from flyaround.simulator.runtime.arrays import Float32Array

# Constant added to the variance in batch normalisation, against division by zero.
EPSILON = 1e-4


class ResidualNetwork(nn.Module):  # type: ignore[misc]
    """Residual network that regresses the position and classifies the attitude of a target in an image.

    Parameters
    ----------
    architecture : Architecture
        Layer sizes and strides.
    width_px : int
        Width of the input images.
    height_px : int
        Height of the input images.
    classes : int
        Number K of attitude classes.

    References
    ----------
    He et al. (2015), Delving deep into rectifiers, ICCV (initial weights); Ioffe & Szegedy (2015), Batch normalization,
    ICML; Goyal et al. (2017), Accurate, large minibatch SGD, arXiv:1706.02677 (blocks initialised as the identity).
    """

    def __init__(self, architecture: Architecture, width_px: int, height_px: int, classes: int) -> None:
        super().__init__()
        self.architecture = architecture
        self.layers = nn.ModuleDict()
        for name, (shape, stride) in architecture.layers(width_px, height_px, classes).items():
            outputs, inputs = shape[:2]
            if name in {"place", "attitude"}:
                self.layers[name] = layer = nn.Linear(inputs, outputs)
                nn.init.normal_(layer.weight, std=np.sqrt(0.01 / inputs))
                nn.init.zeros_(layer.bias)
                continue
            # with a momentum of 1 the running statistics are those of the last batch: the training averages them itself
            if len(shape) == 2:
                layer = nn.Linear(inputs, outputs, bias=False)
                norm: nn.Module = nn.BatchNorm1d(outputs, EPSILON, momentum=1.0)
            else:
                layer = nn.Conv2d(inputs, outputs, shape[2], stride, shape[2] // 2, bias=False)
                norm = nn.BatchNorm2d(outputs, EPSILON, momentum=1.0)
            nn.init.kaiming_normal_(layer.weight)
            if name.endswith("_second"):
                nn.init.zeros_(norm.weight)
            self.layers[name] = nn.Sequential(layer, norm)

    def forward(self, pictures: Tensor) -> tuple[Tensor, Tensor]:
        """Return positions (B, 3) and attitude logits (B, K) of standardised images (B, h, w)."""

        def rectified(name: str, x: Tensor) -> Tensor:
            return torch.relu(self.layers[name](x))

        x = functional.max_pool2d(rectified("stem", pictures[:, None]), 3, stride=2, padding=1)
        for name, *_ in self.architecture.residual_blocks():
            y, shortcut = self.layers[f"{name}_second"](rectified(f"{name}_first", x)), f"{name}_shortcut"
            x = torch.relu(y + (self.layers[shortcut](x) if shortcut in self.layers else x))
        place = rectified("place_hidden", rectified("squeeze", x).flatten(1))
        attitude = rectified("attitude_hidden", x.amax(dim=(2, 3)))
        return self.layers["place"](place), self.layers["attitude"](attitude)

    def folded(self) -> dict[str, Float32Array]:
        """Return the weights ``NAME`` and ``NAME_bias`` of each layer, with batch normalisation folded in."""
        weights = {}
        for name, layer in copy.deepcopy(self).cpu().double().eval().layers.items():
            if isinstance(layer, nn.Sequential):
                fuse = fuse_conv_bn_eval if isinstance(layer[0], nn.Conv2d) else fuse_linear_bn_eval
                layer = fuse(*layer)  # noqa: PLW2901 - the same layer
            weights[name] = layer.weight.detach().numpy().astype(np.float32)
            weights[f"{name}_bias"] = layer.bias.detach().numpy().astype(np.float32)
        return weights
