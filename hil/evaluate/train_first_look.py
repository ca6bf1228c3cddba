"""Trains a target's first look (hil/board/svd/look) on views drawn by `first_look_pictures`; needs the extra `train`.

python -m hil.evaluate.first_look_pictures tango -n 10000 -o VIEWS
python -m hil.evaluate.train_first_look tango VIEWS -o hil/board/svd/look/tango.npz --minutes 30
"""

from __future__ import annotations

import argparse
import os
import time
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.board.svd import quaternion as quat
from hil.board.svd.look.attitudes import ANCHORS, bumps, even_attitudes
from hil.board.svd.look.net import LOOK_PX, STRIDES, VERSION, Net
from hil.evaluate.first_look_samples import Batch, Views, sample
from hil.evaluate.worker import board_model
from simulator.targets.library import load_target

# one thread: boards and desks alike have other work
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")

import jax
import jax.numpy as jnp

if TYPE_CHECKING:
    from collections.abc import Callable

    from simulator.arrays import FloatArray

    Tree = dict[str, jax.Array]

# Channels after each convolution, after the squeeze, and of the hidden layer.
CHANNELS, SQUEEZED, HIDDEN = (16, 40, 80, 96, 128), 64, 192

BATCH, RATE = 64, 2e-3

# Attitudes compared in one step, and how many random turns of them there are; width of the wanted bump [rad].
COMPARED, TURNS, WIDTH_RAD = 2048, 8, float(np.radians(7.0))

# How often it tells how it does.
REPORTS = 8

# Attitudes that a report looks among.
GRID = 6000

# Share of the weights' running mean that each step keeps.
KEEP = 0.995


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
    cells = LOOK_PX // int(np.prod(STRIDES))
    layer("hidden", (cells * cells * SQUEEZED, HIDDEN))
    layer("heads", (HIDDEN, ANCHORS + 4), 0.01)
    return {k: jnp.asarray(v, jnp.float32) for k, v in out.items()}


def forward(weights: Tree, running: Tree | None, looks: jax.Array) -> tuple[jax.Array, Tree]:
    """Outputs (B, J + 4), and mean and variance of each layer in this batch.

    Parameters
    ----------
    running : means and variances to use instead of the batch's own (Ioffe & Szegedy 2015), or None.
    """
    seen: Tree = {}

    def normalised(name: str, x: jax.Array) -> jax.Array:
        if running is None:
            axes = tuple(range(x.ndim - 1))
            mean, var = x.mean(axes), x.var(axes)
        else:
            mean, var = running[f"{name}_mean"], running[f"{name}_var"]
        seen[f"{name}_mean"], seen[f"{name}_var"] = mean, var
        x = (x - mean) * jax.lax.rsqrt(var + 1e-4)
        return jax.nn.relu(x * weights[f"{name}_scale"] + weights[f"{name}_bias"])

    x = looks
    for k, stride in enumerate(STRIDES):
        kernel = weights[f"kernel{k}"]
        side = kernel.shape[0]
        before = (side - stride) // 2 if stride > 1 else side // 2
        pad = (before, side - before - stride)
        x = jax.lax.conv_general_dilated(
            x, kernel, (stride, stride), (pad, pad), dimension_numbers=("NHWC", "HWIO", "NHWC")
        )
        x = normalised(f"kernel{k}", x)
    x = normalised("squeeze", x @ weights["squeeze"]).reshape(len(looks), -1)
    x = normalised("hidden", x @ weights["hidden"])
    return x @ weights["heads"] + weights["heads_bias"], seen


def loss(
    weights: Tree, looks: jax.Array, wanted: jax.Array, basis: jax.Array, box: jax.Array, craft: jax.Array
) -> tuple[jax.Array, tuple[Tree, jax.Array]]:
    """Cross-entropy over attitudes, robust error of place and size, cross-entropy of there being a craft."""
    out, seen = forward(weights, None, looks)
    there = craft / jnp.maximum(craft.sum(), 1.0)
    likely = jax.nn.log_softmax(out[:, :ANCHORS] @ basis, axis=1)
    attitude = -(there[:, None] * wanted * likely).sum()
    e = jnp.abs(out[:, ANCHORS : ANCHORS + 3] - box) / jnp.array([0.05, 0.05, 0.05])
    place = (there[:, None] * jnp.where(e < 1, 0.5 * e * e, e - 0.5)).sum()
    z = out[:, ANCHORS + 3]
    present = (jax.nn.softplus(z) - craft * z).mean()
    return attitude + 0.3 * place + present, (seen, jnp.stack([attitude, place, present]))


def adam_step(
    weights: Tree, means: Tree, moment: Tree, square: Tree, count: float, rate: float, *batch: jax.Array
) -> tuple[Tree, Tree, Tree, Tree, jax.Array]:
    """One step of Adam (Kingma & Ba 2015) with decay of the weights.

    Parameters
    ----------
    means : running means of the weights and of each layer's mean and variance.
    """
    slopes, (seen, parts) = jax.grad(loss, has_aux=True)(weights, *batch)
    size = jnp.sqrt(sum(jnp.vdot(g, g) for g in slopes.values()))
    slopes = {k: g * jnp.minimum(1.0, 5.0 / size) for k, g in slopes.items()}
    moment = {k: 0.9 * moment[k] + 0.1 * g for k, g in slopes.items()}
    square = {k: 0.99 * square[k] + 0.01 * g * g for k, g in slopes.items()}

    def moved(k: str) -> jax.Array:
        m, s = moment[k] / (1 - 0.9**count), square[k] / (1 - 0.99**count)
        decay = 1e-2 if weights[k].ndim > 1 else 0.0
        return weights[k] - rate * (m / (jnp.sqrt(s) + 1e-8) + decay * weights[k])

    weights = {k: moved(k) for k in weights}
    # early steps count for little in the means
    keep = jnp.minimum(KEEP, count / (count + 20))
    means = {k: keep * means[k] + (1 - keep) * v for k, v in (weights | seen).items()}
    return weights, means, moment, square, parts


step = jax.jit(adam_step)


def prepared(batch: Batch, grid: FloatArray) -> tuple[Any, ...]:
    """A batch as `loss` takes it, the wanted likelihood of each attitude of the grid included."""
    angle = 2 * np.arccos(np.minimum(np.abs(batch.q_wxyz @ grid.T), 1.0))
    wanted = np.exp(-0.5 * (angle / WIDTH_RAD) ** 2) + 1e-9
    wanted /= wanted.sum(axis=1, keepdims=True)
    return (
        batch.looks,
        wanted.astype(np.float32),
        batch.box.astype(np.float32),
        batch.craft.astype(np.float32),
    )


def folded(means: Tree) -> dict[str, FloatArray]:
    """The layers with their normalisations multiplied in, as the board has them."""
    w = {k: np.asarray(v, float) for k, v in means.items()}
    out = {"heads": w["heads"], "heads_bias": w["heads_bias"]}
    for name in (*(f"kernel{k}" for k in range(len(STRIDES))), "squeeze", "hidden"):
        scale = w[f"{name}_scale"] / np.sqrt(w[f"{name}_var"] + 1e-4)
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


def recall(net: Net, batch: Batch, most: int = 32) -> str:
    """How often an attitude within some degrees is among the best 1, 4, 8, 16, 32; errors of place and size."""
    coefficients, box = net(batch.looks)
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


def train(views: Views, minutes: float, seed: int, report: Callable[[str, Tree], None]) -> Tree:
    """Running means of weights and statistics after ``minutes``."""
    rng = np.random.default_rng(seed)
    weights = start_weights(seed)
    zero = {k: jnp.zeros_like(v) for k, v in weights.items()}
    moment, square = zero, zero
    grids = []
    for _ in range(TURNS):
        p, r = quat.normalise(rng.normal(size=4)), quat.normalise(rng.normal(size=4))
        grid = quat.multiply(quat.multiply(p, even_attitudes(COMPARED)), r)
        grids.append((grid, jnp.asarray(bumps(grid).T, jnp.float32)))
    _, seen = forward(weights, None, jnp.asarray(sample(views, rng, BATCH).looks))
    means = weights | seen
    start, count, done, told = time.monotonic(), 0, 0.0, 0.0
    losses = np.zeros(3)
    with ThreadPoolExecutor(1) as pool:
        ahead = pool.submit(sample, views, rng, BATCH)
        while done < 1:
            batch = ahead.result()
            ahead = pool.submit(sample, views, rng, BATCH)
            grid, basis = grids[count % TURNS]
            looks, wanted, box, craft = prepared(batch, grid)
            count += 1
            done = (time.monotonic() - start) / (60 * minutes)
            rate = RATE * min(1.0, count / 200) * 0.5 * (1 + np.cos(np.pi * min(done, 1.0))) + 1e-5
            weights, means, moment, square, parts = step(
                weights, means, moment, square, float(count), rate, looks, wanted, basis, box, craft
            )
            losses = 0.98 * losses + 0.02 * np.asarray(parts)
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
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--views-used", type=int, default=None)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    n = options.views_used or len(np.load(options.views / "pose.npy", mmap_mode="r"))
    views = Views.read(options.views, 0, n - n // 20)
    held = sample(Views.read(options.views, n - n // 20, n), np.random.default_rng(1), 100)

    def report(text: str, means: Tree) -> None:
        write(options.output, folded(means), options.target)
        print(text, "|", recall(Net.read(str(options.output)), held), flush=True)  # noqa: T201

    report("end", train(views, options.minutes, options.seed, report))


if __name__ == "__main__":
    main()
