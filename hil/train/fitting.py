"""Steps of any training: Adam with decay of the weights, a falling rate, and the weights' running mean.

References
----------
Loshchilov & Hutter (2019), Decoupled weight decay regularization, ICLR; Polyak & Juditsky (1992), Acceleration of
stochastic approximation by averaging, SIAM J. Control Optim. 30(4).
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import torch

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.hil.train.layers import Tree
    from flyaround.simulator.runtime.arrays import FloatArray

    Step = tuple[torch.Tensor, FloatArray, Tree]

Batch = TypeVar("Batch")

RATE, DECAY, LARGEST_GRADIENT = 2e-3, 1e-2, 5.0

# Steps in which the rate rises.
WARM_UP = 200

# Share of the weights' running mean that each step keeps.
KEEP = 0.998

# How often it tells how it does.
REPORTS = 10


@dataclass(frozen=True, kw_only=True)
class Budget:
    """How long to train: so many minutes of this machine, or so many steps, which is the same on any."""

    minutes: float = 6.0
    steps: int | None = None

    def done(self, began_s: float, steps: int) -> float:
        """Share 0..1 of it that is used up."""
        if self.steps is not None:
            return steps / self.steps
        return (time.monotonic() - began_s) / (60 * self.minutes)


def fit(
    weights: Tree,
    draw: Callable[[], Batch],
    step: Callable[[Batch, int], Step],
    budget: Budget,
    report: Callable[[float, str, Tree], None],
    rate: float = RATE,
) -> Tree:
    """Train in place; the running means of the weights, and of the statistics that ``step`` saw.

    Parameters
    ----------
    draw : makes a batch, in a thread beside the step before. step : loss, its parts and statistics of a batch.
    report : given now and then the share done, a line of text, and the means so far. rate : the highest.
    """
    adam = torch.optim.AdamW(
        [
            {"params": [w for w in weights.values() if w.ndim > 1], "weight_decay": DECAY},
            {"params": [w for w in weights.values() if w.ndim == 1], "weight_decay": 0.0},
        ],
        lr=rate,
        betas=(0.9, 0.99),
    )
    means: Tree = {}
    began, count, done, told = time.monotonic(), 0, 0.0, 0.0
    losses: FloatArray | None = None
    with ThreadPoolExecutor(1) as pool:
        ahead = pool.submit(draw)
        while done < 1:
            batch = ahead.result()
            ahead = pool.submit(draw)
            done = min(budget.done(began, count + 1), 1.0)
            count += 1
            for group in adam.param_groups:
                falling = 0.5 * (1 + np.cos(np.pi * done))
                group["lr"] = rate * min(1.0, count / WARM_UP) * falling + 1e-5
            total, parts, seen = step(batch, count)
            adam.zero_grad()
            total.backward()
            torch.nn.utils.clip_grad_norm_(weights.values(), LARGEST_GRADIENT)
            adam.step()
            # early steps count for little in the means
            keep = min(KEEP, count / (count + 20))
            with torch.no_grad():
                for k, v in (weights | seen).items():
                    means[k] = v.clone() if count == 1 else means[k].lerp_(v, 1 - keep)
            losses = (np.zeros(len(parts)) if losses is None else 0.98 * losses) + 0.02 * parts
            if done - told > 1 / REPORTS or done >= 1:
                told = done
                said = " ".join(f"{x:.3f}" for x in losses / (1 - 0.98**count))
                report(done, f"{count} steps, loss {said}", means)
    return means
