"""Steps of the keypoint network's training: AdamW, a rate that falls to zero, and the running mean of the weights.

References
----------
Li et al. (2022), SimCC: a simple coordinate classification perspective for human pose estimation; Loshchilov & Hutter
(2019), Decoupled weight decay regularization; Polyak & Juditsky (1992), Acceleration of stochastic approximation by
averaging.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch.nn import functional

from flyaround.hil.board.hybrid.propose.keypoints.network_output import BINS, REACH, STEP

if TYPE_CHECKING:
    from torch import Tensor

    from flyaround.hil.train.keypoints.samples import Batch

# Width of the wanted distribution of a keypoint [bins], and the weights of presence and size against it.
WIDTH_BINS, PRESENCE, SIZE = 1.6, 0.3, 1.0

# Largest rate, its weight decay, steps in which it rises, and the largest gradient.
RATE, DECAY, WARM_UP, LARGEST_GRADIENT = 2e-3, 0.02, 300, 5.0

# Share of the running mean of the weights that each step keeps.
KEEP = 0.998


def wanted(points: Tensor) -> tuple[Tensor, Tensor]:
    """Return (B, K, 2, BINS) distributions to learn, and (B, K, 2) 1 where the keypoint is within reach.

    Parameters
    ----------
    points : Tensor
        (B, K, 2) tensor Keypoints from the middle of the input [half sides].
    """
    centres = (torch.arange(BINS) + 0.5) * STEP - REACH
    off = (points[..., None] - centres) / (WIDTH_BINS * STEP)
    shape = torch.exp(-0.5 * off * off)
    return shape / shape.sum(-1, keepdim=True).clamp_min(1e-6), (points.abs() < REACH).float()


def loss(outputs: tuple[Tensor, Tensor], batch: Batch) -> tuple[Tensor, Tensor]:
    """Return the cross-entropy of the keypoints of the craft that are there, and the whole loss.

    Parameters
    ----------
    outputs : tuple of Tensor
        Pair of tensors Of a `Head`.
    batch : Batch
        The truth.
    """
    logits, whole = (x.float() for x in outputs)
    present, size = torch.from_numpy(batch.present), torch.from_numpy(batch.log_size)
    shape, within = wanted(torch.from_numpy(batch.points))
    weight = within * present[:, None, None]
    entropy = -(shape * functional.log_softmax(logits, -1)).sum(-1)
    keypoints = (entropy * weight).sum() / weight.sum().clamp_min(1.0)
    presence = functional.binary_cross_entropy_with_logits(whole[:, 0], present)
    off = functional.smooth_l1_loss(whole[:, 1], size, reduction="none", beta=0.1)
    return keypoints, keypoints + PRESENCE * presence + SIZE * (off * present).mean()
