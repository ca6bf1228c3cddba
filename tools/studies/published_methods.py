"""Studies of docs/svd_results.md: methods, solvers, streams, a wrong model, a wrong exposure.

``python -m tools.studies.published_methods SET REPORTS --parts methods --feasible 30`` prints tables in Markdown.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.hil.board.estimation import BoardModel
from flyaround.hil.board.method_names import HYBRID
from flyaround.hil.board.svd.settings import SOLVERS
from flyaround.hil.evaluate.dataset_evaluation import ROWS, evaluate_dataset, method_metrics
from flyaround.hil.evaluate.method_choice import MethodChoice, board_model
from flyaround.hil.evaluate.result_rows import EvaluatedFrame, existing_rows
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.formats.native import frame_paths, is_frame_complete, write_frame
from flyaround.simulator.frame import take_frame
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.targets.library import load_target
from tools.studies.paired_tables import paired, table, units_table, write_into_page

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence


# the thesis's version samples as few points of a figure as a solver needs; the published one gives it all of them,
# although P3P and AP3P cannot use the fourth
FEW = tuple(MethodChoice("svd-thesis", s) for s in ("p3p", *(s for s in SOLVERS if s != "p3p")))
ALL = tuple(MethodChoice("svd-2018", s) for s in SOLVERS if s not in ("p3p", "ap3p"))

# the streams of the method itself are the first choice of ``FEW``
STREAMS = tuple(
    MethodChoice("svd-thesis", None, k)
    for k in (("wge",), ("sh",), ("lsd",), ("wge", "sh", "lsd"), ("wge", "sh", "harris"))
)
PUBLISHED = (*FEW, *ALL, *STREAMS)

# number of waves whose sum is the displacement of a wrong model
WAVES = 60

BEST = MethodChoice(HYBRID)
METHODS = (MethodChoice("svd-2018"), MethodChoice("svd-thesis"))

MODEL_ERRORS_M = (0.002, 0.005)  # standard deviation of the model's distortion, per axis
EXPOSURE_FACTORS = (0.25, 4.0)  # factors on the exposure


def wrong_model(model: BoardModel, sigma_m: float, seed: int = 7) -> BoardModel:
    """Return a model distorted at random, by ``sigma_m`` along each axis: wireframe, occluding mesh and rendered faces.

    Notes
    -----
    The displacement is a smooth random field that varies over a quarter of the model's radius: adjacent parts stay
    joined, and the small faces of a subdivided large one stay nearly coplanar.
    """
    rng = np.random.default_rng(seed)
    waves = rng.normal(0.0, 4.0 / model.radius_m, (3, WAVES, 3))
    phases = rng.uniform(0.0, 2 * np.pi, (3, WAVES))

    def moved(points: np.ndarray) -> np.ndarray:
        p = np.asarray(points, float)
        shift = [np.cos(p @ w.T + phase).sum(axis=-1) for w, phase in zip(waves, phases, strict=True)]
        return p + sigma_m * np.sqrt(2.0 / WAVES) * np.stack(shift, axis=-1)

    edges = tuple(replace(e, a_m=moved(e.a_m), b_m=moved(e.b_m)) for e in model.wireframe)
    faces = model.faces
    if faces is not None:
        corners = moved(faces.corners)
        normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        # a triangle repeats its last corner
        flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = np.where((normals * faces.normals).sum(axis=1, keepdims=True) > 0, normals, flat)
        size = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = np.where(size > 1e-12, normals / np.maximum(size, 1e-12), faces.normals)
        offset = np.einsum("fi,fi->f", normals, corners.mean(axis=1))
        faces = replace(faces, corners=corners, normals=normals, offset=offset)
    return replace(
        model,
        wireframe=edges,
        vertices_m=moved(model.vertices_m.reshape(-1, 3)),
        faces=faces,
        sha256=f"{model.sha256}+{sigma_m}",
    )


def expose(folder: Path, out: Path, factor: float, frames: Sequence[int] | None = None) -> Path:
    """Return a data set of the same frames, or ``frames`` of them, rendered with ``factor`` times the exposure."""
    card = read_card(folder)
    numbers = range(card.n_frames) if frames is None else frames
    missing = [k for k in numbers if is_frame_complete(folder, k) and not is_frame_complete(out, k)]
    if not missing and (out / "dataset.json").is_file():
        return out
    (out / "images").mkdir(parents=True, exist_ok=True)
    target = load_target(card.target.name)
    with Renderer() as renderer:
        for k in missing:
            truth = read_truth(frame_paths(folder, k).truth)
            scene = replace(truth.scene, exposure_s=truth.scene.exposure_s * factor)
            frame = take_frame(renderer, scene, target)
            if frame.truth is None:
                raise RuntimeError("a labelled frame needs its truth")
            # feasibility is that of the frame at the right exposure
            rescaled = msgspec.structs.replace(
                frame.truth, feasible=truth.feasible, infeasible_reason=truth.infeasible_reason
            )
            write_frame(out, k, replace(frame, truth=rescaled))
    (out / "dataset.json").write_bytes((folder / "dataset.json").read_bytes())
    return out


def feasible_frames(folder: Path, most: int) -> list[int]:
    """Return the first ``most`` solvable frames of a set."""
    numbers: list[int] = []
    for k in range(read_card(folder).n_frames):
        if len(numbers) == most:
            break
        if is_frame_complete(folder, k) and read_truth(frame_paths(folder, k).truth).feasible:
            numbers.append(k)
    return numbers


class Study:
    """Parts of the studies on one data set.

    Parameters
    ----------
    folder : Path
        Folder of the data set.
    reports : Path
        Folder of the evaluations; existing evaluations are continued.
    feasible : int or None
        Number of feasible frames to use; None for all frames.
    workers : int
        Number of processes.
    evaluate : bool
        True to evaluate missing frames; otherwise the tables use the frames that every method has answered.
    """

    def __init__(
        self, folder: Path, reports: Path, *, feasible: int | None, workers: int, evaluate: bool
    ) -> None:
        self.folder, self.reports, self.workers, self.evaluate = folder, reports, workers, evaluate
        self.name = read_card(folder).scenario_name
        self.model = board_model(load_target(read_card(folder).target.name))
        self.frames = None if feasible is None else feasible_frames(folder, feasible)
        self.parts: dict[str, Callable[[], str]] = {
            "methods": self.methods,
            "units": self.units,
            "solvers": lambda: self.published((*FEW, *ALL), FEW[0]),
            "streams": lambda: self.published((FEW[0], *STREAMS), FEW[0]),
            "model": self.bent,
            "exposure": self.exposure,
        }

    def rows(
        self,
        name: str,
        choices: Sequence[MethodChoice],
        of: Path | None = None,
        model: BoardModel | None = None,
    ) -> list[EvaluatedFrame]:
        """Return the rows of an evaluation for the frames that all its methods have answered."""
        report = self.reports / name
        if self.evaluate:
            report.mkdir(parents=True, exist_ok=True)
            evaluate_dataset(
                of or self.folder,
                report,
                methods=tuple(choices),
                model=model,
                workers=self.workers,
                frames=self.frames,
            )
        rows = existing_rows(report / ROWS)
        answered = Counter(r.frame for r in rows)
        return [r for r in rows if answered[r.frame] == len(choices)]

    def published(self, choices: Sequence[MethodChoice], first: MethodChoice) -> str:
        """Return a table of variants of the published methods, with paired counts against one of them."""
        # all methods answer a frame before the next one, so that an interrupted evaluation can be compared
        rows = self.rows("published", PUBLISHED)
        return compared(rows, [c.label for c in choices], first.label)

    def methods(self) -> str:
        """Return the table of three methods; the published ones on the frames that were evaluated."""
        return compared(
            [*self.rows("methods", METHODS), *self.rows(HYBRID, [BEST])],
            [*(c.label for c in METHODS), BEST.label],
            METHODS[1].label,
        )

    def units(self) -> str:
        """Return the thesis's mean errors in degrees and radians."""
        rows = self.rows("methods", METHODS)
        return units_table(
            [(c.label, [r.record for r in rows if r.method == c.label]) for c in METHODS[::-1]]
        )

    def bent(self) -> str:
        """Return the best method with a distorted model."""
        rows_by_model = {"exact": self.rows(HYBRID, [BEST])}
        for sigma in MODEL_ERRORS_M:
            wrong = wrong_model(self.model, sigma)
            rows_by_model[f"bent by {1e3 * sigma:g} mm"] = self.rows(f"model-{sigma}", [BEST], model=wrong)
        return together(rows_by_model)

    def exposure(self) -> str:
        """Return the best method with a wrong exposure."""
        rows_by_exposure = {"right exposure": self.rows(HYBRID, [BEST])}
        for factor in EXPOSURE_FACTORS:
            folder = self.reports / f"set-exposure-{factor}"
            exposed = expose(self.folder, folder, factor, self.frames) if self.evaluate else folder
            rows_by_exposure[f"exposure x {factor:g}"] = self.rows(f"exposure-{factor}", [BEST], of=exposed)
        return together(rows_by_exposure)


def compared(rows: Sequence[EvaluatedFrame], labels: Sequence[str], first: str) -> str:
    """Return a table of some methods, with frames gained and lost relative to the first."""
    present = [label for label in labels if any(r.method == label for r in rows)]
    metrics = [(label, method_metrics(label, [r for r in rows if r.method == label])) for label in present]
    differ = []
    for label in present:
        gained, lost, p = paired(rows, first, label)
        differ.append("" if label == first else f"{gained}, {lost} ({max(p, 1e-99):.2g})")
    return table(metrics, differ)


def together(by_condition: dict[str, list[EvaluatedFrame]]) -> str:
    """Return a table of one method under several conditions, for the frames answered under all of them."""
    common = set.intersection(*({r.frame for r in rows} for rows in by_condition.values()))
    first, *_ = by_condition
    rows = [
        msgspec.structs.replace(r, method=name)
        for name, all_rows in by_condition.items()
        for r in all_rows
        if r.frame in common
    ]
    return compared(rows, list(by_condition), first)


def main() -> int:
    """Run the chosen parts of the studies."""
    parser = argparse.ArgumentParser(prog="tools.studies.published_methods", description=__doc__)
    parser.add_argument("set", type=Path, help="a data set written by capture")
    parser.add_argument("reports", type=Path, help="folder of the reports; an existing one is continued")
    parser.add_argument(
        "--parts",
        default="methods",
        help="comma-separated: methods,units,solvers,streams,model,exposure",
    )
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--feasible", type=int, help="use only the first N feasible frames")
    parser.add_argument("--tables", action="store_true", help="print tables of existing evaluations only")
    parser.add_argument(
        "--page",
        type=Path,
        help="page whose tables (<!-- study PART SCENARIO -->) are replaced; missing ones are skipped",
    )
    options = parser.parse_args()
    study = Study(
        options.set,
        options.reports,
        feasible=options.feasible,
        workers=options.workers,
        evaluate=not options.tables,
    )
    for part in options.parts.split(","):
        if part not in study.parts:
            parser.error(f"unknown part {part!r}: known parts are {', '.join(study.parts)}")
    for part in options.parts.split(","):
        text = study.parts[part]()
        sys.stdout.write(f"### {part}: {study.name}\n\n{text}\n\n")
        sys.stdout.flush()
        if options.page is not None and f"<!-- study {part} {study.name} -->" in options.page.read_text(
            "utf-8"
        ):
            write_into_page(options.page, part, study.name, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
