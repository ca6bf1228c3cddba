"""The studies of docs/svd_results.md: methods, solvers, streams, steps towards ours, a wrong model, a wrong exposure.

``python -m hil.evaluate.study SET REPORTS --parts methods,solvers --feasible 30`` prints tables in Markdown.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from hil.board.svd import BoardModel
from hil.board.svd.faithful.config import SOLVERS, STEPS
from hil.evaluate.run import evaluate_dataset
from hil.evaluate.worker import MethodChoice, board_model
from simulator.dataset.card import read_card
from simulator.dataset.native import frame_paths, is_whole, write_frame
from simulator.labels.frame import take_frame
from simulator.labels.truth import read_truth
from simulator.render.renderer import Renderer
from simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.evaluate.metrics import MethodMetrics

LADDER = tuple(MethodChoice("svd-thesis", None, None, tuple(STEPS)[:k]) for k in range(1, len(STEPS) + 1))

# The thesis's version draws as few points of a figure as a solver takes; the published one gives it all of them, where
# P3P and AP3P have no use for the fourth.
FEW = tuple(MethodChoice("svd-thesis", s) for s in ("p3p", *(s for s in SOLVERS if s != "p3p")))
ALL = tuple(MethodChoice("svd-2018", s) for s in SOLVERS if s not in ("p3p", "ap3p"))

# Its own two streams are the first of ``FEW``, all three the first of ``LADDER``.
STREAMS = tuple(
    MethodChoice("svd-thesis", None, k) for k in (("wge",), ("sh",), ("lsd",), ("wge", "sh", "harris"))
)
PUBLISHED = (*FEW, *ALL, *STREAMS, *LADDER)

# Waves that make up the shift of a wrong model.
WAVES = 60

MODEL_ERRORS_M = (0.002, 0.005)
EXPOSURE_FACTORS = (0.25, 4.0)


def wrong_model(model: BoardModel, sigma_m: float, seed: int = 7) -> BoardModel:
    """A model bent at random, ``sigma_m`` along each axis: wireframe, hiding mesh and drawn faces alike.

    Notes
    -----
    The shift is a smooth random field that varies over a quarter of the model's radius, so that what meets stays joined
    and the small faces that a large one was cut into stay nearly plane.
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
        # three corners: the last stands twice
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
    """The same frames, all or some, drawn again with ``factor`` times the exposure; labels are the same."""
    card = read_card(folder)
    asked = range(card.n_frames) if frames is None else frames
    missing = [k for k in asked if is_whole(folder, k) and not is_whole(out, k)]
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
            # whether a frame can be solved is a matter of the right exposure
            same = msgspec.structs.replace(
                frame.truth, feasible=truth.feasible, infeasible_reason=truth.infeasible_reason
            )
            write_frame(out, k, replace(frame, truth=same))
    (out / "dataset.json").write_bytes((folder / "dataset.json").read_bytes())
    return out


def table(rows: Sequence[tuple[str, MethodMetrics]]) -> str:
    """Rows in Markdown."""

    def share(value: float | None, interval: tuple[float, float] | None) -> str:
        if value is None or interval is None:
            return "-"
        return f"{100 * value:.0f} % ({100 * interval[0]:.0f}-{100 * interval[1]:.0f})"

    def number(value: float | None, factor: float = 1.0) -> str:
        if value is None:
            return "-"
        x = factor * value
        return f"{x:.0f}" if abs(x) >= 100 else f"{x:.3g}"

    lines = [
        (
            "| | coarse | fine | available | false of accepted | median E_R deg, E_T mm (all) | "
            "mean E_T mm accepted (all) | failures | p50 ms |"
        ),
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, m in rows:
        wrong = round((m.false_accept or 0.0) * m.n_accepted)
        lines.append(
            f"| {name} | {share(m.coarse_success, m.coarse_success_wilson)} | "
            f"{share(m.fine_success, m.fine_success_wilson)} | {share(m.availability, m.availability_wilson)} | "
            f"{wrong} of {m.n_accepted} | {number(m.median_E_R_deg_all)}, {number(m.median_E_T_m_all, 1e3)} | "
            f"{number(m.mean_E_T_m, 1e3)} ({number(m.mean_E_T_m_all, 1e3)}) | "
            f"{', '.join(f'{n} {k}' for k, n in m.failures.items()) or '-'} | {number(m.time_ms_p50)} |"
        )
    return "\n".join(lines)


def feasible_frames(folder: Path, most: int) -> list[int]:
    """The first ``most`` frames of a set that can be solved."""
    found: list[int] = []
    for k in range(read_card(folder).n_frames):
        if len(found) == most:
            break
        if is_whole(folder, k) and read_truth(frame_paths(folder, k).truth).feasible:
            found.append(k)
    return found


def run_parts(
    folder: Path, reports: Path, parts: Sequence[str], workers: int, feasible: int | None = None
) -> str:
    """Every part's table; what was evaluated before is gone on with.

    Parameters
    ----------
    feasible : so many of the feasible frames alone; None: all frames.

    Raises
    ------
    UserError
        If the folder is not a data set.
    """
    model = board_model(load_target(read_card(folder).target.name))
    frames = None if feasible is None else feasible_frames(folder, feasible)
    out = []

    def evaluated(
        name: str, choices: Sequence[MethodChoice], of: Path = folder, given: BoardModel | None = None
    ) -> list[tuple[str, MethodMetrics]]:
        place = reports / name
        place.mkdir(parents=True, exist_ok=True)
        metrics = evaluate_dataset(
            of, place, methods=tuple(choices), model=given, workers=workers, frames=frames
        )
        return list(metrics.by_method.items())

    def published(choices: Sequence[MethodChoice]) -> list[tuple[str, MethodMetrics]]:
        # each frame by all before the next one: what there is at any time compares
        found = dict(evaluated("published", PUBLISHED))
        return [(c.label, found[c.label]) for c in choices]

    def methods() -> list[tuple[str, MethodMetrics]]:
        return evaluated("methods", [MethodChoice(m) for m in ("svd", "svd-2018", "svd-thesis")])

    def solvers() -> list[tuple[str, MethodMetrics]]:
        return published((*FEW, *ALL))

    def streams() -> list[tuple[str, MethodMetrics]]:
        return published((FEW[0], *STREAMS[:3], LADDER[0], STREAMS[3]))

    def ablation() -> list[tuple[str, MethodMetrics]]:
        return [*published((ALL[0], FEW[0], *LADDER)), *evaluated("svd", [MethodChoice("svd")])]

    def wrong() -> list[tuple[str, MethodMetrics]]:
        rows = evaluated("svd", [MethodChoice("svd")])
        for sigma in MODEL_ERRORS_M:
            found = evaluated(f"model-{sigma}", [MethodChoice("svd")], given=wrong_model(model, sigma))
            rows += [(f"{name}, bent by {1e3 * sigma:g} mm", m) for name, m in found]
        return rows

    def exposure() -> list[tuple[str, MethodMetrics]]:
        rows = evaluated("svd", [MethodChoice("svd")])
        for factor in EXPOSURE_FACTORS:
            other = expose(folder, reports / f"set-exposure-{factor}", factor, frames)
            found = evaluated(f"exposure-{factor}", [MethodChoice("svd")], of=other)
            rows += [(f"{name}, exposure x {factor:g}", m) for name, m in found]
        return rows

    known: dict[str, Callable[[], list[tuple[str, MethodMetrics]]]] = {
        "methods": methods,
        "solvers": solvers,
        "streams": streams,
        "ablation": ablation,
        "model": wrong,
        "exposure": exposure,
    }
    for part in parts:
        out.append(f"### {part}: {folder.name}\n\n{table(known[part]())}\n")
        sys.stdout.write(out[-1] + "\n")
        sys.stdout.flush()
    return "\n".join(out)


def main() -> int:
    """Run parts of the studies from the command line."""
    parser = argparse.ArgumentParser(prog="hil.evaluate.study", description=__doc__)
    parser.add_argument("set", type=Path, help="a data set written by capture")
    parser.add_argument("reports", type=Path, help="folder of the reports, gone on with when it exists")
    parser.add_argument("--parts", default="methods", help="methods,solvers,streams,ablation,model,exposure")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--feasible", type=int, help="the first so many feasible frames alone")
    options = parser.parse_args()
    run_parts(options.set, options.reports, options.parts.split(","), options.workers, options.feasible)
    return 0


if __name__ == "__main__":
    sys.exit(main())
