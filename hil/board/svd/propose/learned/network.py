"""The pose proposal network in numpy: input channels, layers, weights file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import BinaryIO, Optional, Tuple, Union

import cv2
import numpy as np
from numpy.lib.stride_tricks import as_strided

from flyaround.hil.board.svd.native.backend import accelerated
from flyaround.hil.board.svd.native.learned import network_input as native_input
from flyaround.hil.board.svd.native.learned.convolution import Layers
from flyaround.hil.board.svd.native.learned.convolution import network_convolutions as native_convolutions

Array = np.ndarray

# Side of the network's input [px], and share of it that the target's sphere fills when the crop is right.
INPUT_PX, INPUT_FILL = 64, 0.72

# Side of the neighbourhood of the contrast channel [px].
CONTRAST_PX = 13

# Stride of each convolution; the first has 5 x 5 taps, the others 3 x 3.
STRIDES = (2, 2, 2, 1, 2)

VERSION = 1


@dataclass(frozen=True, eq=False)
class ProposalNetwork:
    """Weights of one target's pose proposal network.

    Parameters
    ----------
    name : of the target. centre_m (3,), radius_m : of the sphere it was trained with.
    kernels : (k, k, C, D) per convolution; biases (D,). squeeze (D, E), (E,) : one-by-one convolution after the last.
    hidden : (n, H), (H,). heads : (H, J + 4), (J + 4,): attitude coefficients, shift x y, log size, craft or not.
    """

    name: str
    centre_m: Array
    radius_m: float
    kernels: Tuple[Array, ...]
    biases: Tuple[Array, ...]
    squeeze: Tuple[Array, Array]
    hidden: Tuple[Array, Array]
    heads: Tuple[Array, Array]

    @staticmethod
    def read(file: Union[str, BinaryIO]) -> ProposalNetwork:
        """From an ``.npz`` file of half-precision weights.

        Raises
        ------
        ValueError
            If it was written for another version of the layers.
        """
        with np.load(file) as f:
            if int(f["version"]) != VERSION:
                raise ValueError(f"learned proposal: version {int(f['version'])}, expected {VERSION}")
            n = len(STRIDES)

            def wide(key: str) -> Array:
                return np.asarray(f[key], np.float32)

            return ProposalNetwork(
                str(f["name"]),
                np.asarray(f["centre_m"], float),
                float(f["radius_m"]),
                tuple(wide(f"kernel{k}") for k in range(n)),
                tuple(wide(f"bias{k}") for k in range(n)),
                (wide("squeeze"), wide("squeeze_bias")),
                (wide("hidden"), wide("hidden_bias")),
                (wide("heads"), wide("heads_bias")),
            )

    def __call__(self, inputs: Array) -> Tuple[Array, Array]:
        """Attitude coefficients (B, J), and (B, 4) shift x y, log size, logit of a target being there.

        Parameters
        ----------
        inputs : (B, 64, 64, 2) float32, see ``contrast``.
        """
        x = _convolutions(self, inputs)
        x = np.maximum(x @ self.squeeze[0] + self.squeeze[1], 0.0).reshape(len(x), -1)
        x = np.maximum(x @ self.hidden[0] + self.hidden[1], 0.0)
        out = x @ self.heads[0] + self.heads[1]
        return out[:, :-4], out[:, -4:]

    @cached_property
    def layers(self) -> Optional[Layers]:
        """The convolutions as C takes them."""
        return Layers.of(self.kernels, self.biases, STRIDES)


def _in_whole_numbers(net: ProposalNetwork, _: Array) -> bool:
    return net.layers is not None


@accelerated(native_convolutions, _in_whole_numbers)
def _convolutions(net: ProposalNetwork, x: Array) -> Array:
    """(B, h, w, D) features after all convolutions, each followed by a rectifier."""
    for kernel, bias, stride in zip(net.kernels, net.biases, STRIDES):  # noqa: B905 - 3.9
        x = convolve(x, kernel, stride)
        # in place: new memory for each would cost as much as a layer's product
        x += bias
        np.maximum(x, 0.0, out=x)
    return x


def convolve(x: Array, kernel: Array, stride: int) -> Array:
    """(B, H / s, W / s, D) convolution of (B, H, W, C), zeros around it, as one product of matrices."""
    k = kernel.shape[0]
    before = (k - stride) // 2 if stride > 1 else k // 2
    b, h, w, c = x.shape
    padded = np.zeros((b, h + k, w + k, c), np.float32)
    padded[:, before : before + h, before : before + w] = x
    rows, cols = h // stride, w // stride
    # a row of a patch lies in one piece: copied whole, not tap by tap
    sb, sy, sx, sc = padded.strides
    views = as_strided(
        padded, (b, rows, cols, k, k * c), (sb, stride * sy, stride * sx, sy, sc), writeable=False
    )
    patches = np.ascontiguousarray(views).reshape(-1, k * k * c)
    return np.asarray(patches @ kernel.reshape(k * k * c, -1)).reshape(b, rows, cols, -1)


@accelerated(native_input.contrast)
def contrast(pictures: Array, noise: Array) -> Array:
    """(B, 64, 64, 2) input channels of crops: their level, and their local contrast.

    Parameters
    ----------
    pictures : (B, 64, 64) float32, any scale. noise : (B,) standard deviation of each one's noise.

    Notes
    -----
    Neither channel depends on exposure: the level is measured by the brightest half percent, the contrast by its
    own neighbourhood's, but noise is left small.
    """
    count = len(pictures)
    flat = pictures.reshape(count, -1)
    bright = flat.shape[1] - flat.shape[1] // 200
    noise = np.asarray(noise, np.float32)
    top = np.maximum(np.maximum(np.partition(flat, bright, axis=1)[:, bright], 6.0 * noise), 1e-9)
    # all at once, as channels of one picture: a call for each would cost more than its work
    layers = np.ascontiguousarray(pictures.transpose(1, 2, 0), np.float32)
    level = np.sqrt(np.clip(layers / top, 0.0, 1.2))
    away = layers - _blurred(layers)
    spread = np.sqrt(_blurred(away * away) + (2.0 * noise + 0.004 * top) ** 2)
    out = np.stack([level - 0.3, 0.5 * np.clip(away / spread, -3.0, 3.0)], axis=-1)
    return np.ascontiguousarray(out.transpose(2, 0, 1, 3), np.float32)


def _blurred(layers: Array) -> Array:
    """(H, W, B) mean of each layer over the neighbourhood of the contrast channel."""
    side = (CONTRAST_PX, CONTRAST_PX)
    # OpenCV takes 128 channels at most
    parts = [cv2.blur(layers[..., k : k + 64], side) for k in range(0, layers.shape[2], 64)]
    return np.concatenate([part.reshape(*layers.shape[:2], -1) for part in parts], axis=2)
