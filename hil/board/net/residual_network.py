"""Residual network in NumPy: one image in, place in the image with range, and attitude class logits out.

The place is computed from all cells of the feature map. The attitude, relative to the line of sight and so
independent of the place, is computed from global max pooling: a view learned at one place is recognised at all
others.

References
----------
He et al. (2016), Deep residual learning for image recognition, CVPR; Proenca & Gao (2020), Deep learning for spacecraft
pose estimation from photorealistic rendering, ICRA.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, Iterator, Tuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

Array = np.ndarray


@dataclass(frozen=True)
class Architecture:
    """Layer sizes of a network.

    Parameters
    ----------
    stem : int
        Channels after the first convolution.
    stages : tuple of int
        Channels of each stage; every stage but the first halves the resolution.
    blocks : int
        Residual blocks per stage.
    squeezed : int
        Channels of the place head's input.
    hidden : int
        Hidden units of each head.
    """

    stem: int
    stages: Tuple[int, ...]
    blocks: int
    squeezed: int
    hidden: int

    def residual_blocks(self) -> Iterator[Tuple[str, int, int, int]]:
        """Yield the name, input channels, output channels and stride of each residual block."""
        before = self.stem
        for s, channels in enumerate(self.stages):
            for b in range(self.blocks):
                yield f"stage{s}_{b}", before, channels, 2 if b == 0 and s > 0 else 1
                before = channels

    def layers(self, width_px: int, height_px: int, classes: int) -> Dict[str, Tuple[Tuple[int, ...], int]]:
        """Return the layers of the network for an input size.

        Returns
        -------
        dict of str to tuple
            Weight shape, outputs first, and stride by the name of the layer; dense layers have a stride of 1.
        """
        layers: Dict[str, Tuple[Tuple[int, ...], int]] = {"stem": ((self.stem, 1, 7, 7), 2)}
        for name, before, channels, stride in self.residual_blocks():
            layers[f"{name}_first"] = (channels, before, 3, 3), stride
            layers[f"{name}_second"] = (channels, channels, 3, 3), 1
            if stride != 1 or before != channels:
                layers[f"{name}_shortcut"] = (channels, before, 1, 1), stride
        last, halved = self.stages[-1], 2 ** (1 + len(self.stages))
        cells = -(-width_px // halved) * -(-height_px // halved)
        layers["squeeze"] = (self.squeezed, last, 1, 1), 1
        layers["place_hidden"] = (self.hidden, self.squeezed * cells), 1
        layers["place"] = (3, self.hidden), 1
        layers["attitude_hidden"] = (self.hidden, last), 1
        layers["attitude"] = (classes, self.hidden), 1
        return layers

    def run(self, weights: Dict[str, Array], picture: Array) -> Tuple[Array, Array]:
        """Return the place (3,) and the logits (K,) of K attitude classes, not finite if the weights overflow.

        The place is x / z and y / z in halves of the field of view, and the standardised logarithm of the range.

        Parameters
        ----------
        weights : dict of str to array
            Weights ``NAME`` and ``NAME_bias`` of each layer, float32, with batch normalisation folded in.
        picture : (h, w) array
            Standardised image, float32.

        Returns
        -------
        tuple of array
            Place (3,) and logits (K,).
        """

        def convolved(name: str, x: Array, stride: int = 1) -> Array:
            return convolve(x, weights[name], weights[f"{name}_bias"], stride)

        def dense(name: str, x: Array) -> Array:
            return np.asarray(weights[name] @ x + weights[f"{name}_bias"])

        with np.errstate(over="ignore", invalid="ignore"):
            x = _windows(_relu(convolved("stem", picture[None], 2)), 3, 2).max(axis=(3, 4))
            for name, _, _, stride in self.residual_blocks():
                y = convolved(f"{name}_second", _relu(convolved(f"{name}_first", x, stride)))
                shortcut = f"{name}_shortcut"
                x = _relu(y + (convolved(shortcut, x, stride) if shortcut in weights else x))
            squeezed = _relu(convolved("squeeze", x)).reshape(-1)
            place = dense("place", _relu(dense("place_hidden", squeezed)))
            attitude = dense("attitude", _relu(dense("attitude_hidden", x.max(axis=(1, 2)))))
        return place, attitude


ARCHITECTURES = {
    # for training on a CPU; sized here, not published
    "small": Architecture(stem=16, stages=(24, 48, 128), blocks=1, squeezed=16, hidden=256),
    # ResNet-18 of He et al.
    "resnet18": Architecture(stem=64, stages=(64, 128, 256, 512), blocks=2, squeezed=32, hidden=512),
}


def convolve(x: Array, weight: Array, bias: Array, stride: int) -> Array:
    """Return the cross-correlation (O, h', w') of maps (C, h, w) with weights (O, C, k, k), zero-padded."""
    windows = _windows(x, weight.shape[2], stride)
    h, w = windows.shape[1:3]
    columns = windows.transpose(0, 3, 4, 1, 2).reshape(-1, h * w)
    return np.asarray(weight.reshape(len(weight), -1) @ columns + bias[:, None]).reshape(-1, h, w)


def _windows(x: Array, side: int, stride: int) -> Array:
    """Return a view (C, h', w', side, side) of the windows of zero-padded maps (C, h, w)."""
    pad = side // 2
    padded = np.pad(x, ((0, 0), (pad, pad), (pad, pad)))
    return sliding_window_view(padded, (side, side), axis=(1, 2))[:, ::stride, ::stride]


def _relu(x: Array) -> Array:
    """Set negative values to zero in place, and return the array."""
    return np.maximum(x, 0.0, out=x)
