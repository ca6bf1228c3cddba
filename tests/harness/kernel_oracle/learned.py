"""The learned proposal and the noise in numpy and OpenCV: what the compiled library must compute."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.lib.stride_tricks import as_strided

from flyaround.hil.board.hybrid.propose.learned.attitude_basis import harmonics
from flyaround.hil.board.hybrid.propose.learned.network import CONTRAST_PX, STRIDES
from flyaround.hil.board.hybrid.propose.learned.view_subspaces import (
    QUARTERS,
    SHAPES,
    SHIFTS_PX,
    SIDE_PX,
    SIZES,
    TURNS,
    WIDE_PX,
)

if TYPE_CHECKING:
    from flyaround.hil.board.hybrid.propose.learned.network import ProposalNetwork
    from flyaround.hil.board.hybrid.propose.learned.view_subspaces import ViewSubspaces

Array = np.ndarray

HARMONICS = harmonics()


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


def likelihoods(views: ViewSubspaces, said: Array) -> Array:
    """(N, V * TURNS) log-likelihoods of ``attitude_basis.quartered`` coefficients (N, 4, ANCHORS)."""
    even, odd = said[:, :2], said[:, 2] - 1j * said[:, 3]
    # a look turned by a quarter sees another turn of the same direction: by a factor of -i to the power of m
    of_power = [even[:, 0], odd, even[:, 1], odd.conj()]
    sums = np.stack([w @ of_power[m % QUARTERS].T.astype(np.complex64) for m, w in enumerate(waves(views))])
    c, s = _circle().T
    turns = (c + 1j * s)[:, None] ** np.arange(len(HARMONICS))
    likely = np.real(np.tensordot(turns, sums, axes=1))
    return np.ascontiguousarray(likely.transpose(2, 1, 0).reshape(len(said), -1), np.float32)


def waves(views: ViewSubspaces) -> Array:
    """(HARMONICS + 1, V, ANCHORS) complex64 harmonics of the bumps; the kernels make them as they go."""
    size, cosine, sine = (views.bumps[k].astype(float) for k in range(3))
    step = cosine - 1j * sine
    out = np.empty((len(HARMONICS), *size.shape), np.complex64)
    wave = size.astype(complex)
    for m, h in enumerate(HARMONICS):
        out[m] = h * wave
        wave *= step
    return out


def explained_shares(
    views: ViewSubspaces, picture: Array, view: Array, turn: Array, taken: Array
) -> tuple[Array, Array]:
    """Share (C,) that attitudes explain at their best move, and its number (C,).

    Parameters
    ----------
    taken : (V,) share that noise gives to as many shapes.
    """
    share, at = np.zeros(len(view)), np.zeros(len(view), int)
    weight = views.window.ravel() ** 2
    for k in np.unique(turn):
        rows = np.flatnonzero(turn == k)
        X = _moved(picture, 2 * np.pi * float(k) / TURNS)
        energy = (X * X) @ weight + 1e-9
        P = views.basis[view[rows]].reshape(-1, X.shape[1]) @ X.T
        S = np.einsum("vks,vks->vs", *2 * [P.reshape(len(rows), SHAPES, -1)]) / energy
        own = taken[view[rows]][:, None]
        S = np.clip((S - own) / (1 - own), 0.0, 0.99)
        at[rows] = S.argmax(axis=1)
        share[rows] = S.max(axis=1)
    return share, at


def _moved(picture: Array, turn: float) -> Array:
    """(moves, N) the picture turned back, at every size and shift, without wide structures."""
    n, m, shifts = SIDE_PX, SIDE_PX + 2 * SHIFTS_PX, 2 * SHIFTS_PX + 1
    out = np.empty((len(SIZES), shifts, shifts, n, n), np.float32)
    middle, to = 0.5 * (picture.shape[0] - 1) - 0.5, 0.5 * (m - 1)
    for size, of_size in zip(SIZES, out):  # noqa: B905 - Python 3.9 has no strict=
        c, s = 2 * size * np.cos(turn), 2 * size * np.sin(turn)
        M = np.array([[c, -s, middle - (c - s) * to], [s, c, middle - (s + c) * to]])
        small = _narrow(
            cv2.warpAffine(
                picture,
                M,
                (m, m),
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_REPLICATE,
            )
        )
        sy, sx = small.strides
        shifted = as_strided(small, (shifts, shifts, n, n), (sy, sx, sy, sx), writeable=False)
        of_size[:] = shifted
    return out.reshape(-1, n * n)


def _narrow(picture: Array) -> Array:
    return np.asarray(picture - cv2.GaussianBlur(picture, (0, 0), WIDE_PX))


def _circle() -> Array:
    """(TURNS, 2) cosine and sine of each turn."""
    angle = 2 * np.pi * np.arange(TURNS) / TURNS
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)
