"""Trains a target's learned proposal on views drawn by `proposal_views`; needs the extra `train`.

python -m tools.train.proposal_views tango -n 30000 -o VIEWS
python -m tools.train.learned_proposal tango VIEWS -o hil/board/svd/propose/learned/weights/tango.npz --minutes 50

A craft that is not the first may begin with what another's network sees (`--start tango`): a third of the time is
enough.
"""

from __future__ import annotations

import argparse
import time
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

try:
    import torch
    from torch.nn import functional
except ImportError as error:
    raise ImportError("training a learned proposal needs PyTorch: pip install 'flyaround[train]'") from error

from hil.board.svd.geometry import quaternion as quat
from hil.board.svd.propose.learned.attitude_basis import ANCHORS, bumps, even_attitudes
from hil.board.svd.propose.learned.learned_proposal import shipped_network
from hil.board.svd.propose.learned.network import INPUT_PX, STRIDES, VERSION, ProposalNetwork
from hil.evaluate.method_choice import board_model
from simulator.targets.library import load_target
from tools.train.proposal_samples import Batch, Views, sample

if TYPE_CHECKING:
    from collections.abc import Callable

    from simulator.runtime.arrays import FloatArray

    Tree = dict[str, torch.Tensor]

# Channels after each convolution, after the squeeze, and of the hidden layer.
CHANNELS, SQUEEZED, HIDDEN = (24, 48, 96, 112, 128), 64, 224

BATCH, RATE, DECAY = 64, 2e-3, 1e-2

# Attitudes compared in one step, and how many random turns of them there are; width of the wanted bump [rad].
COMPARED, TURNS, WIDTH_RAD = 2048, 8, float(np.radians(6.0))

# How often it tells how it does.
REPORTS = 10

# Attitudes that a report inputs among.
GRID = 6000

# Looks by which another craft's network is taken over.
STATISTICS = 512

# Share of the weights' running mean that each step keeps.
KEEP = 0.998

# Errors of place and size from which they count linearly [half sides, log]; what they weigh against attitude.
ROBUST, PLACE_WEIGHT = 0.05, 0.3

# Added to a variance before it divides.
EPSILON = 1e-4

LAYERS = (*(f"kernel{k}" for k in range(len(STRIDES))), "squeeze", "hidden")


def start_weights(seed: int) -> Tree:
    """Random weights by He et al. (2015), and the scale and shift of each normalisation."""
    rng = np.random.default_rng(seed)
    out: dict[str, FloatArray] = {}

    def layer(name: str, shape: tuple[int, ...], gain: float = 2.0) -> None:
        fan = int(np.prod(shape[:-1]))
        out[name] = rng.normal(0, np.sqrt(gain / fan), shape)
        out[f"{name}_scale"], out[f"{name}_bias"] = np.ones(shape[-1]), np.zeros(shape[-1])

    last = 2
    for k, channels in enumerate(CHANNELS):
        side = 5 if k == 0 else 3
        layer(f"kernel{k}", (side, side, last, channels))
        last = channels
    layer("squeeze", (last, SQUEEZED))
    cells = INPUT_PX // int(np.prod(STRIDES))
    layer("hidden", (cells * cells * SQUEEZED, HIDDEN))
    layer("heads", (HIDDEN, ANCHORS + 4), 0.01)
    del out["heads_scale"]
    return {k: torch.tensor(v, dtype=torch.float32, requires_grad=True) for k, v in out.items()}


def weights_of(net: ProposalNetwork, inputs: torch.Tensor, seed: int) -> Tree:
    """Weights that see what another craft's network sees, and know no attitude of this one yet.

    Parameters
    ----------
    inputs : (B, 64, 64, 2) of which each normalisation takes the mean and spread that it undoes.
    """
    weights = start_weights(seed)
    layers = {f"kernel{k}": pair for k, pair in enumerate(zip(net.kernels, net.biases, strict=True))}
    for name, (kernel, bias) in (layers | {"squeeze": net.squeeze, "hidden": net.hidden}).items():
        with torch.no_grad():
            weights[name].copy_(torch.from_numpy(kernel))
            # the layers before this one are right by now
            _, seen = forward(weights, None, inputs)
            spread = torch.sqrt(seen[f"{name}_var"] + EPSILON)
            weights[f"{name}_scale"].copy_(spread)
            weights[f"{name}_bias"].copy_(torch.from_numpy(bias) + seen[f"{name}_mean"])
    with torch.no_grad():
        for key, there in zip(("heads", "heads_bias"), net.heads, strict=True):
            weights[key][..., ANCHORS:] = torch.from_numpy(there[..., ANCHORS:])
    return weights


def forward(weights: Tree, running: Tree | None, inputs: torch.Tensor) -> tuple[torch.Tensor, Tree]:
    """Outputs (B, J + 4), and mean and variance of each layer in this batch.

    Parameters
    ----------
    running : means and variances to use instead of the batch's own (Ioffe & Szegedy 2015), or None.
    """
    seen: Tree = {}

    def normalised(name: str, x: torch.Tensor) -> torch.Tensor:
        if running is None:
            # what a step of a running mean with weight one keeps are the batch's own
            mean, var = torch.zeros(x.shape[1]), torch.zeros(x.shape[1])
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
        return torch.relu_(x)

    x = inputs.permute(0, 3, 1, 2)
    for k, stride in enumerate(STRIDES):
        kernel = weights[f"kernel{k}"].permute(3, 2, 0, 1).contiguous(memory_format=torch.channels_last)
        side = kernel.shape[-1]
        before = (side - stride) // 2 if stride > 1 else side // 2
        after = side - before - stride
        x = functional.conv2d(functional.pad(x, (before, after, before, after)), kernel, stride=stride)
        x = normalised(f"kernel{k}", x)
    cells = x.permute(0, 2, 3, 1)
    flat = normalised("squeeze", cells.reshape(-1, cells.shape[-1]) @ weights["squeeze"])
    flat = normalised("hidden", flat.reshape(len(inputs), -1) @ weights["hidden"])
    return flat @ weights["heads"] + weights["heads_bias"], seen


def loss(
    out: torch.Tensor, wanted: torch.Tensor, basis: torch.Tensor, box: torch.Tensor, craft: torch.Tensor
) -> tuple[torch.Tensor, FloatArray]:
    """Cross-entropy over attitudes, robust error of place and size, cross-entropy of there being a craft."""
    there = craft / torch.clamp(craft.sum(), min=1.0)
    likely = torch.log_softmax(out[:, :ANCHORS] @ basis, dim=1)
    attitude = -(there[:, None] * wanted * likely).sum()
    e = (out[:, ANCHORS : ANCHORS + 3] - box).abs() / ROBUST
    place = (there[:, None] * torch.where(e < 1, 0.5 * e * e, e - 0.5)).sum()
    present = functional.binary_cross_entropy_with_logits(out[:, ANCHORS + 3], craft)
    parts = np.array([attitude.item(), place.item(), present.item()])
    return attitude + PLACE_WEIGHT * place + present, parts


def wanted_likelihood(q_wxyz: FloatArray, grid: FloatArray) -> torch.Tensor:
    """(B, N) likelihood of each attitude of a grid (N, 4): a bump about the true one."""
    angle = 2 * np.arccos(np.minimum(np.abs(q_wxyz.astype(np.float32) @ grid.T.astype(np.float32)), 1.0))
    wanted = np.exp(-0.5 * (angle / np.float32(WIDTH_RAD)) ** 2) + np.float32(1e-9)
    return torch.from_numpy(wanted / wanted.sum(axis=1, keepdims=True))


def folded(means: Tree) -> dict[str, FloatArray]:
    """The layers with their normalisations multiplied in, as the board has them."""
    w = {k: v.detach().double().numpy() for k, v in means.items()}
    out = {"heads": w["heads"], "heads_bias": w["heads_bias"]}
    for name in LAYERS:
        scale = w[f"{name}_scale"] / np.sqrt(w[f"{name}_var"] + EPSILON)
        out[name] = w[name] * scale
        out[name.replace("kernel", "bias") if "kernel" in name else f"{name}_bias"] = (
            w[f"{name}_bias"] - w[f"{name}_mean"] * scale
        )
    return out


def write(path: Path, layers: dict[str, FloatArray], target: str) -> None:
    """Half-precision weights with the name and the sphere of the target."""
    model = board_model(load_target(target))
    half = {k: v.astype(np.float16) for k, v in layers.items()}
    with path.open("wb") as file:
        np.savez_compressed(
            file,
            allow_pickle=False,
            version=np.int64(VERSION),
            name=np.str_(model.name),
            centre_m=model.centre_m,
            radius_m=np.float64(model.radius_m),
            **half,
        )


def likeliest(coefficients: FloatArray, keep: int) -> FloatArray:
    """(K, 4) the likeliest of a grid of attitudes, none within 12 degrees of a better one."""
    grid = even_attitudes(GRID)
    chosen: list[int] = []
    for i in np.argsort(-(_basis() @ coefficients))[:400]:
        if not chosen or quat.angle_rad(grid[chosen], grid[i]).min() > np.radians(12.0):
            chosen.append(int(i))
        if len(chosen) >= keep:
            break
    return grid[chosen]


@cache
def _basis() -> FloatArray:
    return np.asarray(bumps(even_attitudes(GRID)), np.float32)


def recall(net: ProposalNetwork, batch: Batch, most: int = 32) -> str:
    """How often an attitude within some degrees is among the best 1, 4, 8, 16, 32; errors of place and size."""
    coefficients, box = net(batch.inputs)
    rank = []
    for i in np.flatnonzero(batch.craft > 0):
        error = np.degrees(quat.angle_rad(likeliest(coefficients[i], most), batch.q_wxyz[i]))
        rank.append(np.pad(error, (0, most - len(error)), constant_values=180))
    best = np.minimum.accumulate(np.array(rank), axis=1)
    shares = [
        f"{limit} deg: " + " ".join(f"{(best[:, k - 1] < limit).mean():.3f}" for k in (1, 4, 8, 16, 32))
        for limit in (6, 10, 15)
    ]
    e = np.abs(box[:, :3] - batch.box)[batch.craft > 0]
    right = ((box[:, 3] > 0) == (batch.craft > 0)).mean()
    return "; ".join([*shares, f"box {np.round(np.median(e, axis=0), 3)}, craft {right:.3f}"])


def train(
    views: Views,
    minutes: float,
    seed: int,
    report: Callable[[str, Tree], None],
    start: ProposalNetwork | None = None,
) -> Tree:
    """Running means of weights and statistics after ``minutes``: Adam with decay of the weights, falling rate.

    Parameters
    ----------
    start : network of another craft to begin with, or None for random weights.
    """
    # one thread: boards and desks alike have other work
    torch.set_num_threads(1)
    rng = np.random.default_rng(seed)
    if start is None:
        weights = start_weights(seed)
    else:
        weights = weights_of(start, torch.from_numpy(sample(views, rng, STATISTICS).inputs), seed)
    adam = torch.optim.AdamW(
        [
            {"params": [w for w in weights.values() if w.ndim > 1], "weight_decay": DECAY},
            {"params": [w for w in weights.values() if w.ndim == 1], "weight_decay": 0.0},
        ],
        lr=RATE,
        betas=(0.9, 0.99),
    )
    grids = []
    for _ in range(TURNS):
        p, r = quat.normalise(rng.normal(size=4)), quat.normalise(rng.normal(size=4))
        grid = quat.multiply(quat.multiply(p, even_attitudes(COMPARED)), r)
        grids.append((grid, torch.tensor(bumps(grid).T, dtype=torch.float32)))
    means: Tree = {}
    began, count, done, told = time.monotonic(), 0, 0.0, 0.0
    losses = np.zeros(3)
    with ThreadPoolExecutor(1) as pool:
        ahead = pool.submit(sample, views, rng, BATCH)
        while done < 1:
            batch = ahead.result()
            ahead = pool.submit(sample, views, rng, BATCH)
            grid, basis = grids[count % TURNS]
            count += 1
            done = (time.monotonic() - began) / (60 * minutes)
            for group in adam.param_groups:
                falling = 0.5 * (1 + np.cos(np.pi * min(done, 1.0)))
                group["lr"] = RATE * min(1.0, count / 200) * falling + 1e-5
            out, seen = forward(weights, None, torch.from_numpy(batch.inputs))
            total, parts = loss(
                out,
                wanted_likelihood(batch.q_wxyz, grid),
                basis,
                torch.tensor(batch.box, dtype=torch.float32),
                torch.tensor(batch.craft, dtype=torch.float32),
            )
            adam.zero_grad()
            total.backward()
            torch.nn.utils.clip_grad_norm_(weights.values(), 5.0)
            adam.step()
            # early steps count for little in the means
            keep = min(KEEP, count / (count + 20))
            with torch.no_grad():
                for k, v in (weights | seen).items():
                    means[k] = v.clone() if count == 1 else means[k].lerp_(v, 1 - keep)
            losses = 0.98 * losses + 0.02 * parts
            if done - told > 1 / REPORTS:
                told = done
                report(f"{count} steps, loss {np.round(losses / (1 - 0.98**count), 3)}", means)
    return means


def main() -> None:
    """Train, tell how it does on views that were kept back, write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("target")
    parser.add_argument("views", type=Path)
    parser.add_argument("-o", "--output", required=True, type=Path)
    parser.add_argument("--minutes", type=float, default=50.0)
    parser.add_argument("--views-used", type=int, default=None)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--start", default=None, help="craft whose network to begin with")
    options = parser.parse_args()
    start = None if options.start is None else shipped_network(options.start)
    if options.start is not None and start is None:
        parser.error(f"--start: no network is shipped for '{options.start}'")
    n = options.views_used or len(np.load(options.views / "pose.npy", mmap_mode="r"))
    views = Views.read(options.views, 0, n - n // 20)
    held = sample(Views.read(options.views, n - n // 20, n), np.random.default_rng(1), 300)

    def report(text: str, means: Tree) -> None:
        write(options.output, folded(means), options.target)
        print(text, "|", recall(ProposalNetwork.read(str(options.output)), held), flush=True)

    report("end", train(views, options.minutes, options.seed, report, start))


if __name__ == "__main__":
    main()
