"""Comparison of keypoint networks trained without one randomisation of the samples each (leave one out).

    python -m tools.studies.randomisation train VIEWS OUT --start WEIGHTS --steps 400 --workers 2
    python -m tools.studies.randomisation judge OUT SET [SET ...]

``train`` trains the trunk and Tango's head further from the same weights with every randomisation, and without each of
them in turn, on the same views in the same order. ``judge`` runs each of these networks on the packed crops of captured
images (``tools.train.captured``), which none of them was trained on if the weights in ``--start`` were not, and prints
the differences from the training with every randomisation.
"""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import msgspec
import numpy as np
import torch
from torch import nn

from flyaround.hil.board.hybrid.propose.keypoints.head import KeypointHead
from flyaround.hil.board.hybrid.propose.keypoints.image_crop import ImageCrop
from flyaround.hil.board.hybrid.propose.keypoints.network_input import INPUT_FILL, channels
from flyaround.hil.board.hybrid.propose.keypoints.network_output import keypoints_m
from flyaround.hil.board.hybrid.propose.keypoints.pose_search import pose_modes
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.train.keypoints import fit
from flyaround.hil.train.keypoints.head_training import load_views, state_of
from flyaround.hil.train.keypoints.network import Head, Trunk
from flyaround.hil.train.keypoints.samples import Batch, SampleMix, image_pyramid, sample
from flyaround.hil.train.keypoints.trunk_file import from_onnx, unfold
from flyaround.hil.train.keypoints.view_files import earths_of
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.formats.native import frame_paths
from flyaround.simulator.labels.imported import read_label_record
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from tools.train.captured import read_crops
from tools.train.keypoint_trunk import BATCH, LABORATORY, RATE_AGAIN, drawing

if TYPE_CHECKING:
    from collections.abc import Callable

Array = np.ndarray[Any, Any]

TARGET = "tango"

# Samples without one randomisation each: its value is fixed, or the effect is left out.
VARIANTS: dict[str, SampleMix] = {
    "everything": LABORATORY,
    "light": replace(LABORATORY, lamps=(0.0,), ambient=(0.0,), shadow_share=0.0),
    "materials": replace(
        LABORATORY, surface_spreads=(0.0, 0.0), surface_slopes=(0.0, 0.0), mirror_share=0.0, texture_share=0.0
    ),
    "exposure": replace(
        LABORATORY, misexposed_share=0.0, exposure_sigma=0.0, level_sigma=0.0, level_ranks=(0.97, 0.97)
    ),
    "glow": replace(LABORATORY, glow_share=0.0, stray_light_share=0.0, blur_share=0.0),
    "noise": replace(
        LABORATORY, noise=(0.002, 0.002), noise_log_error=(0.0, 0.0), jpeg_share=0.0, hot_pixel_share=0.0
    ),
    "model error": replace(LABORATORY, deformed_share=0.0, cable_share=0.0, occluded_share=0.0),
}

# A keypoint, or an attitude, that is right [px of the 128 px input; deg]: the pose refinement converges from there.
RIGHT_PX, RIGHT_DEG = 10.0, 20.0


class Network(nn.Module):  # type: ignore[misc]
    """Trunk and head of one target."""

    def __init__(self) -> None:
        super().__init__()
        self.trunk = Trunk().to(memory_format=torch.channels_last)
        self.head = Head()

    def forward(self, inputs: Array) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the outputs of the head for inputs (B, 2, S, S)."""
        x = torch.from_numpy(inputs).float().contiguous(memory_format=torch.channels_last)
        with torch.autocast("cpu", torch.bfloat16):
            logits, whole = self.head(self.trunk(x))
        return logits.float(), whole.float()


def _points() -> Array:
    """Return the keypoints (K, 3) relative to the sphere's centre [radii]."""
    model = board_model(load_target(TARGET))
    return np.asarray((keypoints_m(model) - model.centre_m) / model.radius_m)


def train(views: Path, out: Path, start: Path, steps: int, name: str) -> None:
    """Train one variant and write its weights to ``out``; a finished one is kept."""
    path = out / f"{name.replace(' ', '-')}.pt"
    if path.exists():
        return
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    lit = load_views(drawing(views, TARGET), _points())
    earths = image_pyramid(earths_of(drawing(views, TARGET)))

    def batch(mix: SampleMix, step: int) -> Batch:
        # each step has its own generator, so that every variant sees the same views
        which = np.random.default_rng((1, step)).integers(len(lit.lit), size=BATCH)
        return sample(lit, earths, which, np.random.default_rng((2, step)), mix)

    network = Network()
    first = [batch(LABORATORY, int(rng.integers(1 << 30))).inputs for _ in range(4)]
    unfolded = unfold(
        from_onnx((start / "trunk.onnx").read_bytes()), torch.from_numpy(np.concatenate(first)).float()
    )
    network.trunk.load_state_dict(unfolded.state_dict())
    head = KeypointHead.read((start / f"{TARGET}.npz").read_bytes(), TARGET)
    network.head.load_state_dict(state_of(head))
    network.train()
    weights = list(network.parameters())
    adam = torch.optim.AdamW(weights, RATE_AGAIN, weight_decay=fit.WEIGHT_DECAY)
    for step in range(steps):
        samples = batch(VARIANTS[name], step)
        for group in adam.param_groups:
            warm = min(1.0, (step + 1) / (0.1 * steps))
            group["lr"] = RATE_AGAIN * warm * 0.5 * (1 + np.cos(np.pi * step / steps))
        adam.zero_grad(set_to_none=True)
        keypoints, total = fit.loss(network(samples.inputs), samples)
        total.backward()
        nn.utils.clip_grad_norm_(weights, fit.MAX_GRADIENT)
        adam.step()
        if step % 25 == 0:
            print(f"{name}: {step} of {steps} steps, cross-entropy {keypoints.item():.3f}", flush=True)
    out.mkdir(parents=True, exist_ok=True)
    torch.save(network.state_dict(), path)


class Judgement(msgspec.Struct, frozen=True, kw_only=True):
    """Results of one network on each crop of one set.

    Parameters
    ----------
    entropy : (N,) array
        Mean cross-entropy of the keypoints [nats].
    keypoints : (N,) array
        Share of the keypoints within ``RIGHT_PX``.
    attitude : (N,) array
        1 if the most likely attitude is within ``RIGHT_DEG``, else 0.
    """

    entropy: Array
    keypoints: Array
    attitude: Array


def true_attitudes(folder: Path) -> tuple[Array, Array]:
    """Return the rotations (N, 3, 3) crop camera from target of a set's feasible frames, and the crop cameras' focal
    lengths (N,) [half sides].
    """
    card = read_card(folder)
    model = board_model(load_target(card.target.name))
    rotations, focal = [], []
    for k in range(card.n_frames):
        # the images may be gone once their crops are packed
        path = frame_paths(folder, k).truth
        if not path.exists() or not (truth := read_label_record(path)).feasible:
            continue
        R = matrix_from_quat(np.asarray(truth.q_camera_from_target_wxyz, float))
        centre = R @ model.centre_m + np.asarray(truth.t_camera_from_target_m, float)
        distance = float(np.linalg.norm(centre))
        rotations.append(ImageCrop(centre / distance, 1.0).swing().T @ R)
        focal.append(INPUT_FILL / float(np.tan(np.arcsin(model.radius_m / distance))))
    return np.array(rotations), np.array(focal)


def judge(network: Network, folder: Path) -> Judgement:
    """Return the results of a network on the packed crops of a set."""
    crops = next(iter(read_crops([folder]).values()))
    rotations, focal = true_attitudes(folder)
    points_3d = _points()
    entropy, near, right = [], [], []
    network.eval()
    for k in range(len(crops.pictures)):
        picture, noise, points = crops.input_of(k, np.zeros(3), 0.0)
        with torch.no_grad():
            logits, whole = network(channels(picture[None], np.array([noise])).astype(np.float16))
            log_p = torch.log_softmax(logits, -1)
            target, within = fit.target_distributions(torch.from_numpy(points[None].astype(np.float32)))
            entropy.append(float(-(target * log_p).sum(-1)[within > 0].mean()))
        modes = pose_modes(log_p[0].numpy(), points_3d, float(focal[k]), float(whole[0, 1]), 1)
        R = matrix_from_quat(modes.q[0])
        error = np.degrees(np.arccos(np.clip(0.5 * (np.trace(R.T @ rotations[k]) - 1), -1, 1)))
        right.append(float(error < RIGHT_DEG))
        means = (log_p[0].exp() * fit.bin_centres()).sum(-1).numpy()
        near.append(float((np.linalg.norm(means - points, axis=1) * 64 < RIGHT_PX).mean()))
    return Judgement(entropy=np.array(entropy), keypoints=np.array(near), attitude=np.array(right))


def _table(judged: dict[str, Judgement]) -> str:
    """Return the Markdown rows of a recipe: each variant, and its differences with their 95 % intervals."""
    full = judged["everything"]
    rows = []
    for name, j in judged.items():
        cells = []
        for key, scale in (("entropy", 1.0), ("keypoints", 100.0), ("attitude", 100.0)):
            values, base = scale * getattr(j, key), scale * getattr(full, key)
            d = values - base
            gap = "" if j is full else f" ({d.mean():+.2f} +- {1.96 * d.std() / np.sqrt(len(d)):.2f})"
            cells.append(f"{values.mean():.2f}{gap}")
        rows.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(rows)


def compare(out: Path, folders: list[Path]) -> None:
    """Print a table of every trained variant for each recipe."""
    torch.set_num_threads(1)
    recipes: dict[str, list[Path]] = {}
    for folder in folders:
        recipes.setdefault(read_card(folder).scenario_name, []).append(folder)
    for recipe, sets in recipes.items():
        judged = {}
        for name in VARIANTS:
            network = Network()
            network.load_state_dict(torch.load(out / f"{name.replace(' ', '-')}.pt", weights_only=True))
            parts = [judge(network, folder) for folder in sets]
            judged[name] = Judgement(
                **{
                    key: np.concatenate([getattr(p, key) for p in parts])
                    for key in Judgement.__struct_fields__
                }
            )
        print(f"\n{recipe}, {len(judged['everything'].entropy)} crops\n\n{_table(judged)}", flush=True)


def main() -> None:
    """Train or judge the variants."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    commands = parser.add_subparsers(dest="command", required=True)
    trained = commands.add_parser("train", help="train every variant that OUT lacks")
    trained.add_argument("views", type=Path)
    trained.add_argument("out", type=Path)
    trained.add_argument("--start", type=Path, required=True, help="folder with trunk.onnx and tango.npz")
    trained.add_argument("--steps", type=int, default=400)
    trained.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    judged = commands.add_parser("judge", help="print a table")
    judged.add_argument("out", type=Path)
    judged.add_argument("sets", type=Path, nargs="+")
    args = parser.parse_args()
    if args.command == "judge":
        compare(args.out, args.sets)
        return
    one: Callable[[str], None] = partial(train, args.views, args.out, args.start, args.steps)
    with ProcessPoolExecutor(args.workers, mp_context=get_context("spawn")) as pool:
        list(pool.map(one, VARIANTS))


if __name__ == "__main__":
    main()
