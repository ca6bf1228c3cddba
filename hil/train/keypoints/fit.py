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

# Width of the wanted distribution of a keypoint [bins], and the weight of the presence against it.
WIDTH_BINS, PRESENCE = 1.6, 0.3

# Largest rate, its weight decay, steps in which it rises, and the largest gradient.
RATE, DECAY, WARM_UP, LARGEST_GRADIENT = 2e-3, 0.02, 300, 5.0

# Share of the running mean of the weights that each step keeps.
KEEP = 0.998


def wanted(points: Tensor) -> tuple[Tensor, Tensor]:
    """Return (B, K, 2, BINS) distributions to learn, and (B, K, 2) 1 where the keypoint is within reach.

    Parameters
    ----------
    points : (B, K, 2) tensor
        Keypoints from the middle of the input [half sides].
    """
    centres = (torch.arange(BINS) + 0.5) * STEP - REACH
    off = (points[..., None] - centres) / (WIDTH_BINS * STEP)
    shape = torch.exp(-0.5 * off * off)
    return shape / shape.sum(-1, keepdim=True).clamp_min(1e-6), (points.abs() < REACH).float()


def loss(logits: Tensor, logit_present: Tensor, points: Tensor, present: Tensor) -> tuple[Tensor, Tensor]:
    """Return the cross-entropy of the keypoints of the craft that are there, and that of the presence.

    Parameters
    ----------
    logits : (B, K, 2, BINS) tensor
        The network's logits of keypoints.
    logit_present : (B,) tensor
        Its logits of a craft being there.
    points, present : (B, K, 2), (B,) tensors
        The truth.
    """
    shape, within = wanted(points)
    weight = within * present[:, None, None]
    entropy = -(shape * functional.log_softmax(logits, -1)).sum(-1)
    keypoints = (entropy * weight).sum() / weight.sum().clamp_min(1.0)
    return keypoints, functional.binary_cross_entropy_with_logits(logit_present, present)
