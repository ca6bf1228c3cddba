"""Training of a pose network on a data set, and its errors on held-out frames."""

from __future__ import annotations

import copy
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
import torch
from torch.nn import functional

from flyaround.hil.board.net.attitude_classes import class_attitudes, class_step_rad
from flyaround.hil.board.net.network_estimator import NetworkEstimator
from flyaround.hil.board.net.network_file import SIDE_PX, HeldOutErrors, NetworkFile
from flyaround.hil.board.net.residual_network import ARCHITECTURES
from flyaround.hil.evaluate.greyscale import grey
from flyaround.hil.evaluate.mean_predictor import MeanPredictor, mean_predictor
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.evaluate.pose_errors import frame_record
from flyaround.hil.train.fitting import Budget
from flyaround.hil.train.pictures import LabelledPictures, Samples, TrainingSet, read_training_set, sample
from flyaround.hil.train.residual_network import ResidualNetwork
from flyaround.simulator.dataset.formats.native import frame_paths, read_png
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from flyaround.hil.board.net.residual_network import Architecture
    from flyaround.hil.evaluate.pose_errors import FrameScore
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray

    Report = Callable[[float, str], None]

# Batch size.
BATCH = 32

# Standard deviation of the soft attitude labels [class spacings].
LABEL_SIGMA_STEPS = 0.65

# Threshold of the Huber loss of the position [half fields of view, units of log range], and its weight.
POSITION_HUBER, POSITION_WEIGHT = 0.05, 0.5

# Least held-out error stored with a network.
MIN_ERROR = 1e-4

# Settings of AdamW: peak learning rate and weight decay; and maximum norm of the gradient.
LEARNING_RATE, WEIGHT_DECAY, MAX_GRADIENT = 2e-3, 1e-2, 5.0

# Warm-up steps; decay of the exponential moving average of the weights, per step; number of progress reports.
WARM_UP_STEPS, AVERAGE_DECAY, N_REPORTS = 200, 0.998, 10


class TrainingReport(msgspec.Struct, frozen=True, kw_only=True):
    """Errors of a trained network, evaluated as on a board, on the held-out frames of its data set.

    Parameters
    ----------
    network : str
        Name of the network's file.
    target : str
        Name of the target.
    n_learned : int
        Number of training frames.
    n_held_out : int
        Number of held-out frames.
    mean_E_T_m : float
        Mean position error over all held-out frames.
    median_E_T_m : float
        Median position error.
    mean_E_R_deg : float
        Mean attitude error.
    median_E_R_deg : float
        Median attitude error.
    accepted : float
        Share of the held-out frames that are accepted.
    mean_predictor : MeanPredictor
        Errors of the mean pose as the answer to every frame.
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
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> TrainingReport:
    """Train a pose network on a data set, evaluate it on held-out frames, and write its file.

    Parameters
    ----------
    folder : Path
        Data set.
    output : Path
        File to write, ``.npz``.
    architecture : str
        One of ``ARCHITECTURES``.
    width_px : int
        Width of the network's input images.
    classes : int
        Number of attitude classes.
    budget : Budget, optional
        Budget of the training; by default six minutes.
    seed : int
        Seed of initial weights and samples.
    device : str
        PyTorch device.
    threads : int
        Number of processor threads.
    report : callable
        Called with the completed share and a line of text.
    progress : callable
        Called with the number of images read, and the total.

    Returns
    -------
    TrainingReport
        Errors of the network on the held-out frames, with those of the mean predictor.

    Raises
    ------
    UserError
        If the folder is not a data set, has too few frames or images of an unusable size, the training diverges, or the
        file cannot be written.
    """
    if not torch.cuda.is_available() and device.startswith("cuda"):
        raise UserError(f"--device {device}: PyTorch finds no such device here: leave it out")
    torch.set_num_threads(threads)
    data = read_training_set(folder, width_px, progress)
    camera = data.learned.camera
    if not SIDE_PX[0] <= camera.height_px <= SIDE_PX[1]:
        raise UserError(
            f"a network takes pictures with sides of {SIDE_PX[0]} to {SIDE_PX[1]} px, these have {width_px} x "
            f"{camera.height_px}: choose another --width"
        )
    log_range = np.log(np.linalg.norm(data.learned.t_m, axis=1))
    scale = float(log_range.mean()), max(float(log_range.std()), 1e-2)
    training = PoseTraining(ARCHITECTURES[architecture], data.learned, classes, scale, seed, device)
    weights = training.run(budget or Budget(), report)
    if not all(np.isfinite(w).all() for w in weights.values()):
        raise UserError(
            "the training diverged: weights are not finite: choose another --seed, or capture more"
        )
    file = NetworkFile(
        name=output.name,
        target=data.target[0],
        sha256=data.target[1],
        camera=camera,
        classes=classes,
        log_range_mean=scale[0],
        log_range_scale=scale[1],
        errors=HeldOutErrors(1.0, 1.0, 1.0),
        architecture=architecture,
        weights=weights,
    )
    records = _evaluate(file, folder, data)
    file = replace(file, errors=_errors([r for r in records if r.accepted] or records))
    write_atomic(output, file.to_bytes({"dataset": folder.name, "frames": len(data.learned), "seed": seed}))
    E_T, E_R = (np.array([getattr(r, name) for r in records], float) for name in ("E_T_m", "E_R_deg"))
    return TrainingReport(
        network=output.name,
        target=data.target[0],
        n_learned=len(data.learned),
        n_held_out=len(records),
        mean_E_T_m=float(E_T.mean()),
        median_E_T_m=float(np.median(E_T)),
        mean_E_R_deg=float(E_R.mean()),
        median_E_R_deg=float(np.median(E_R)),
        accepted=float(np.mean([r.accepted for r in records])),
        mean_predictor=mean_predictor(data.held_out.q_wxyz, data.held_out.t_m),
    )


class PoseTraining:
    """Training of one network: AdamW, a learning-rate schedule, and the moving average of the weights.

    Parameters
    ----------
    architecture : Architecture
        Layer sizes of the network.
    pictures : LabelledPictures
        Training images.
    classes : int
        Number of attitude classes.
    scale : tuple of float
        Mean and scale of the logarithm of the range.
    seed : int
        Seed of initial weights and samples.
    device : str
        PyTorch device.

    References
    ----------
    Loshchilov & Hutter (2019), Decoupled weight decay regularization, ICLR; Polyak & Juditsky (1992), Acceleration of
    stochastic approximation by averaging, SIAM J. Control Optim. 30(4).
    """

    def __init__(
        self,
        architecture: Architecture,
        pictures: LabelledPictures,
        classes: int,
        scale: tuple[float, float],
        seed: int,
        device: str,
    ) -> None:
        self._pictures, self._scale, self._device = pictures, scale, device
        self._rng = np.random.default_rng([seed, 1])
        self._grid = class_attitudes(classes)
        self._width_rad = LABEL_SIGMA_STEPS * class_step_rad(classes)
        torch.manual_seed(seed)
        camera = pictures.camera
        self.network = ResidualNetwork(architecture, camera.width_px, camera.height_px, classes).to(device)

    def run(self, budget: Budget, report: Report) -> dict[str, Float32Array]:
        """Train, and return the weights for the board.

        Parameters
        ----------
        budget : Budget
            Budget of the training.
        report : callable
            Called ten times with the completed share and a line of text.
        """
        parameters = list(self.network.parameters())
        adam = torch.optim.AdamW(
            [
                {"params": [w for w in parameters if w.ndim > 1], "weight_decay": WEIGHT_DECAY},
                {"params": [w for w in parameters if w.ndim == 1], "weight_decay": 0.0},
            ],
            betas=(0.9, 0.99),
        )
        mean = copy.deepcopy(self.network)
        began, count, done, reported = time.monotonic(), 0, 0.0, 0.0
        losses = np.zeros(2)
        with ThreadPoolExecutor(1) as pool:
            ahead = pool.submit(self._draw)
            while done < 1:
                batch = ahead.result()
                ahead = pool.submit(self._draw)
                done = min(budget.done(began, count + 1), 1.0)
                count += 1
                for group in adam.param_groups:
                    group["lr"] = (
                        LEARNING_RATE * min(1.0, count / WARM_UP_STEPS) * 0.5 * (1 + np.cos(np.pi * done))
                        + 1e-5
                    )
                attitude, place = self._losses(batch)
                adam.zero_grad()
                (attitude + POSITION_WEIGHT * place).backward()
                torch.nn.utils.clip_grad_norm_(parameters, MAX_GRADIENT)
                adam.step()
                # give early steps little weight in the average
                keep = min(AVERAGE_DECAY, count / (count + 20)) if count > 1 else 0.0
                with torch.no_grad():
                    for m, w in zip(
                        mean.state_dict().values(), self.network.state_dict().values(), strict=True
                    ):
                        if m.is_floating_point():
                            m.lerp_(w, 1 - keep)
                losses = 0.98 * losses + 0.02 * np.array([attitude.item(), place.item()])
                if done - reported > 1 / N_REPORTS or done >= 1:
                    reported = done
                    text = " ".join(f"{x:.3f}" for x in losses / (1 - 0.98**count))
                    report(done, f"{count} steps, loss {text}")
        return mean.folded()

    def _draw(self) -> Samples:
        return sample(self._pictures, self._rng, BATCH)

    def _losses(self, batch: Samples) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the attitude and position losses of a batch."""
        place, logits = self.network(torch.from_numpy(batch.pictures).to(self._device))
        target = _soft_classes(batch.q_wxyz, self._grid, self._width_rad).to(self._device)
        mean, spread = self._scale
        numbers = np.concatenate([batch.place, (batch.log_range[:, None] - mean) / spread], axis=1)
        numbers = torch.tensor(numbers, dtype=torch.float32, device=self._device)
        position_loss = functional.smooth_l1_loss(place, numbers, beta=POSITION_HUBER, reduction="none")
        return functional.cross_entropy(logits, target), position_loss.sum(dim=1).mean() / POSITION_HUBER


def _soft_classes(q_wxyz: FloatArray, grid: FloatArray, width_rad: float) -> torch.Tensor:
    """Return probabilities (B, N) of attitude classes (N, 4), Gaussian in the angle to the true attitudes (B, 4)."""
    angle = 2 * np.arccos(np.minimum(np.abs(q_wxyz.astype(np.float32) @ grid.T.astype(np.float32)), 1.0))
    density = np.exp(-0.5 * (angle / np.float32(width_rad)) ** 2) + np.float32(1e-9)
    return torch.from_numpy(density / density.sum(axis=1, keepdims=True))


def _evaluate(file: NetworkFile, folder: Path, data: TrainingSet) -> list[FrameScore]:
    """Return the estimator's scores on the held-out frames."""
    estimator = NetworkEstimator(file, board_model(load_target(data.target[0])), data.camera)
    records = []
    for k, q, t in zip(data.held_out_frames, data.held_out.q_wxyz, data.held_out.t_m, strict=True):
        image = grey(read_png(frame_paths(folder, k).image), data.camera.encoding)
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
    """Return the RMS errors without the largest twentieth."""
    turns = np.array([r.turn_camera_deg for r in records])
    shifts = np.array([r.shift_camera_m for r in records]) / np.array([r.range_m for r in records])[:, None]

    def rms(values: Any) -> float:  # noqa: ANN401 - an array of any shape
        inside = np.abs(values) <= np.quantile(np.abs(values), 0.95)
        return max(float(np.sqrt(np.mean(values[inside] ** 2))), MIN_ERROR)

    return HeldOutErrors(rms(np.radians(turns)), rms(shifts[:, :2]), rms(shifts[:, 2]))
