"""The learned proposal and the noise in numpy and OpenCV: what the compiled library must compute."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.lib.stride_tricks import as_strided

from flyaround.hil.board.hybrid.propose.learned.network import CONTRAST_PX, STRIDES

if TYPE_CHECKING:
    from flyaround.hil.board.hybrid.propose.learned.network import ProposalNetwork

Array = np.ndarray


def network(net: ProposalNetwork, inputs: Array) -> tuple[Array, Array]:
    """Attitude coefficients (B, J), and (B, 4) shift x y, log size, logit of a target being there.

    Parameters
    ----------
    inputs : (B, 64, 64, 2) float32, see ``contrast``.
    """
    x = convolutions(net, inputs)
    x = np.maximum(x @ net.squeeze[0] + net.squeeze[1], 0.0).reshape(len(x), -1)
    x = np.maximum(x @ net.hidden[0] + net.hidden[1], 0.0)
    out = x @ net.heads[0] + net.heads[1]
    return out[:, :-4], out[:, -4:]


def convolutions(net: ProposalNetwork, x: Array) -> Array:
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
