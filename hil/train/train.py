"""From a data set to a network's file, and how well it does on the frames that were held out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
import torch

from flyaround.hil.board.net.attitude_classes import class_attitudes, class_step_rad
from flyaround.hil.board.net.network_estimator import NetworkEstimator
from flyaround.hil.board.net.network_file import HeldOutErrors, NetworkFile
from flyaround.hil.evaluate.greyscale import grey
from flyaround.hil.evaluate.mean_predictor import MeanPredictor, mean_predictor
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.evaluate.pose_errors import frame_record
from flyaround.hil.train.attitude_loss import cross_entropy, robust, soft_classes
from flyaround.hil.train.fitting import Budget, fit
from flyaround.hil.train.forward import folded, forward
from flyaround.hil.train.layers import trainable
from flyaround.hil.train.onnx_file import onnx_bytes, sheet
from flyaround.hil.train.pictures import LabelledPictures, Samples, TrainingSet, read_training_set, sample
from flyaround.hil.train.residual_network import ARCHITECTURES
from flyaround.simulator.dataset.formats.native import frame_paths, read_png
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from flyaround.hil.evaluate.pose_errors import FrameScore
    from flyaround.hil.train.layers import Tree
    from flyaround.hil.train.residual_network import Architecture
    from flyaround.simulator.runtime.arrays import FloatArray

    Report = Callable[[float, str], None]

# Samples of one step.
BATCH = 32

# Width of the wanted likelihood [steps from one class to the next].
WIDTH_STEPS = 0.65

# Error of the place from which it counts linearly [halves of the view, units of log range], and its weight.
PLACE_LINEAR_FROM, PLACE_WEIGHT = 0.05, 0.5

# What the errors of held-out pictures are told as, at least.
LEAST_ERROR = 1e-4


class TrainingReport(msgspec.Struct, frozen=True, kw_only=True):
    """How a network does on the frames of its data set that were held out, through OpenCV, as a board runs it.

    Parameters
    ----------
    n_learned, n_held_out : frames. steps : of training. mean_*, median_* : errors of all held-out frames.
    mean_predictor : the same of one pose for all, the mean of the truths.
    """

    network: str
    target: str
    n_learned: int
    n_held_out: int
    mean_E_T_m: float
    median_E_T_m: float
    mean_E_R_deg: float
    median_E_R_deg: float
    accepted: float
    mean_predictor: MeanPredictor


def train_network(
    folder: Path,
    output: Path,
    *,
    architecture: str = "small",
    width_px: int = 160,
    classes: int = 1024,
    budget: Budget | None = None,
    seed: int = 0,
    device: str = "cpu",
    threads: int = 1,
    report: Report = lambda _done, _text: None,
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> TrainingReport:
    """Train on a data set, write the file, and judge it on the frames that were held out.

    Parameters
    ----------
    output : the file, ``.onnx``. architecture : of ``ARCHITECTURES``. width_px : of the network's pictures.
    classes : attitudes that it tells apart. device : as PyTorch calls it. report : given share done and a line of text.

    Raises
    ------
    UserError
        If the folder is no data set, has too few frames, or the file cannot be written.
    """
    if not torch.cuda.is_available() and device.startswith("cuda"):
        raise UserError(f"--device {device}: PyTorch finds no such device here; leave it out")
    torch.set_num_threads(threads)
    known = read_training_set(folder, width_px, progress)
    network = ARCHITECTURES[architecture]
    log_range = np.log(np.linalg.norm(known.learned.t_m, axis=1))
    scale = float(log_range.mean()), max(float(log_range.std()), 1e-2)
    told = PoseTraining(network, known.learned, classes, scale, seed, device)
    means = told.run(budget or Budget(), lambda done, text, _: report(done, text))
    layers = folded(network, means)

    def written(errors: HeldOutErrors) -> NetworkFile:
        about = sheet(
            known.target,
            known.learned.camera,
            classes,
            scale,
            errors,
            {
                "dataset": folder.name,
                "frames": len(known.learned),
                "architecture": architecture,
                "seed": seed,
            },
        )
        write_atomic(output, onnx_bytes(network, layers, about))
        return NetworkFile.read(output)

    # judged once to know its errors, which then stand in its sheet
    records = _judged(written(HeldOutErrors(1.0, 1.0, 1.0)), folder, known)
    written(_errors([r for r in records if r.accepted] or records))
    E_T, E_R = (np.array([getattr(r, name) for r in records], float) for name in ("E_T_m", "E_R_deg"))
    return TrainingReport(
        network=output.name,
        target=known.target[0],
        n_learned=len(known.learned),
        n_held_out=len(records),
        mean_E_T_m=float(E_T.mean()),
        median_E_T_m=float(np.median(E_T)),
        mean_E_R_deg=float(E_R.mean()),
        median_E_R_deg=float(np.median(E_R)),
        accepted=float(np.mean([r.accepted for r in records])),
        mean_predictor=mean_predictor(known.held_out.q_wxyz, known.held_out.t_m),
    )


class PoseTraining:
    """One network's training.

    Parameters
    ----------
    scale : mean and scale of the logarithm of the range.
    """

    def __init__(
        self,
        network: Architecture,
        pictures: LabelledPictures,
        classes: int,
        scale: tuple[float, float],
        seed: int,
        device: str,
    ) -> None:
        self._network, self._pictures, self._scale, self._device = network, pictures, scale, device
        self._rng = np.random.default_rng([seed, 1])
        self._grid = class_attitudes(classes)
        self._width_rad = WIDTH_STEPS * class_step_rad(classes)
        camera = pictures.camera
        self._weights = trainable(network.start(camera.width_px, camera.height_px, classes, seed))
        if device != "cpu":
            self._weights = {k: w.detach().to(device).requires_grad_() for k, w in self._weights.items()}

    def run(self, budget: Budget, report: Callable[[float, str, Tree], None]) -> Tree:
        """Running means of weights and statistics."""
        return fit(self._weights, self._draw, self._step, budget, report)

    def _draw(self) -> Samples:
        return sample(self._pictures, self._rng, BATCH)

    def _step(self, batch: Samples, _count: int) -> tuple[torch.Tensor, FloatArray, Tree]:
        place, logits, seen = forward(
            self._network, self._weights, None, torch.from_numpy(batch.pictures).to(self._device)
        )
        wanted = soft_classes(batch.q_wxyz, self._grid, self._width_rad).to(self._device)
        attitude = cross_entropy(logits, wanted)
        mean, spread = self._scale
        numbers = np.concatenate([batch.place, (batch.log_range[:, None] - mean) / spread], axis=1)
        off = robust(
            place - torch.tensor(numbers, dtype=torch.float32, device=self._device), PLACE_LINEAR_FROM
        )
        where = off.sum(dim=1).mean()
        return attitude + PLACE_WEIGHT * where, np.array([attitude.item(), where.item()]), seen


def _judged(file: NetworkFile, folder: Path, known: TrainingSet) -> list[FrameScore]:
    """The held-out frames' records, by the estimator itself."""
    estimator = NetworkEstimator(file, board_model(load_target(known.target[0])), known.camera)
    records = []
    for k, q, t in zip(known.held_out_frames, known.held_out.q_wxyz, known.held_out.t_m, strict=True):
        image = grey(read_png(frame_paths(folder, k).image), known.camera.encoding)
        result = estimator.estimate(image)
        records.append(
            frame_record(
                q,
                t,
                result.q_camera_from_target_wxyz,
                result.t_camera_from_target_m,
                accepted=result.accepted,
            )
        )
    return records


def _errors(records: list[FrameScore]) -> HeldOutErrors:
    """RMS about each axis, across and along the line of sight over the range; a wrong one in twenty left out."""
    turns = np.array([r.turn_camera_deg for r in records])
    shifts = np.array([r.shift_camera_m for r in records]) / np.array([r.range_m for r in records])[:, None]

    def rms(values: Any) -> float:  # noqa: ANN401 - an array of any shape
        inside = np.abs(values) <= np.quantile(np.abs(values), 0.95)
        return max(float(np.sqrt(np.mean(values[inside] ** 2))), LEAST_ERROR)

    return HeldOutErrors(rms(np.radians(turns)), rms(shifts[:, :2]), rms(shifts[:, 2]))
