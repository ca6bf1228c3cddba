"""Stage at which `hybrid` loses a pose: every stage on each image of a data set is compared with the truth.

    python -m tools.studies.pose_stages SET            # a table in Markdown, a row per image
    python -m tools.studies.pose_stages SET --limit 10

A data set is a folder written by `flyaround capture` or `flyaround convert`.

| column | meaning |
|---|---|
| region | share of the true bounding box in the best region, and area of that region divided by the box's |
| edges | share of the visible wireframe with an edge under it at the true pose |
| place | error of the learned proposal's location [diameters of the craft's sphere]; its size over the true one |
| proposed | attitude error of the best hypothesis of the first round [deg], and its number in the list |
| stays | error after refinement from the true pose moved by 3 deg and 4 % of the range [deg, % of the range] |
| score | score of the refined true pose, and of the returned pose, on the same patch |
| returned | error [deg, % of the range], confidence, and whether it is accepted |
| lost at | first stage whose result no longer includes the pose |
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.estimator import PoseEstimator, propose_learned
from flyaround.hil.board.hybrid.hypotheses.edge_support import support
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit, Source
from flyaround.hil.board.hybrid.image.edge_field import edge_field
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.image_patch import cut_patch, target_box
from flyaround.hil.board.hybrid.prepare import prepare
from flyaround.hil.board.hybrid.refine.close import CLOSE_PX
from flyaround.hil.board.hybrid.refine.final import refine_to_convergence
from flyaround.hil.board.hybrid.refine.parallel import draw, draw_shadows
from flyaround.hil.board.svd.region_of_interest import Region
from flyaround.hil.evaluate.greyscale import grey
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.evaluate.pose_errors import COARSE_DEG, COARSE_SHARE, frame_errors
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.formats.native import frame_paths, is_frame_complete, read_png
from flyaround.simulator.labels.imported import read_label_record
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.hil.board.hybrid.propose.keypoints.keypoint_proposal import LearnedProposal
    from flyaround.hil.board.hybrid.search_states import PreparedImage

Array = np.ndarray[Any, Any]

# minimum share of edges; maximum errors of a hypothesis [deg, share of the range] and of a location and its size
EDGES, NEAR_DEG, NEAR_SHARE, OFF, RATIO = 0.3, 10.0, 0.1, 0.15, 1.2

# initial pose near the truth: rotation about an axis across the line of sight, and factor of the range
TURN_RAD, FARTHER = float(np.radians(3.0)), 1.04

EDGES_PX = 360  # longest side of the edge field


@dataclass(frozen=True)
class StageRow:
    """Results of the stages on one image; the columns are those of the module's table."""

    frame: int
    range_m: float
    held: float
    too_large: float
    edges: float
    off: float
    size: float
    proposed_deg: float
    proposed_at: int
    stays_deg: float
    stays_share: float
    true_score: float
    returned_score: float
    error_deg: float
    error_share: float
    confidence: float
    accepted: bool

    @property
    def right(self) -> bool:
        """True if the returned pose is right."""
        return self.error_deg <= COARSE_DEG and self.error_share <= COARSE_SHARE

    @property
    def lost_at(self) -> str:
        """First stage that lost the pose."""
        if self.right:
            return "" if self.accepted else "acceptance"
        if self.held < 0.5 and self.off > OFF:
            return "region"
        if self.off > OFF or not 1 / RATIO < self.size < RATIO:
            return "place"
        if self.proposed_deg > NEAR_DEG:
            return "attitude"
        if self.stays_deg > COARSE_DEG or self.stays_share > COARSE_SHARE:
            return "refinement"
        return "selection" if self.returned_score >= self.true_score else "search"

    def cells(self) -> list[str]:
        """Return the cells of the table's row."""
        return [
            str(self.frame),
            f"{self.range_m:.1f}",
            f"{100 * self.held:.0f} %, x {self.too_large:.1f}",
            f"{100 * self.edges:.0f} %",
            f"{self.off:.2f}, x {self.size:.2f}",
            f"{self.proposed_deg:.1f} (#{self.proposed_at + 1})",
            f"{self.stays_deg:.1f}, {100 * self.stays_share:.1f} %",
            f"{self.true_score:.3f}, {self.returned_score:.3f}",
            f"{self.error_deg:.1f}, {100 * self.error_share:.1f} %, {self.confidence:.2f}"
            + (", accepted" if self.accepted else ""),
            self.lost_at,
        ]


HEAD = (
    "picture",
    "range [m]",
    "region",
    "edges",
    "place",
    "proposed [deg]",
    "stays [deg]",
    "score: true, returned",
    "returned [deg]",
    "lost at",
)


def stage_row(
    estimator: PoseEstimator, image: NDArray[Any], q: Array, t: Array, frame_index: int = 0
) -> StageRow:
    """Compare every stage on one image with the truth.

    Parameters
    ----------
    estimator : PoseEstimator
        Estimator whose stages are compared.
    image : (H, W) array
        Image.
    q : (4,) array
        True attitude, camera from target.
    t : (3,) array
        True position [m].
    frame_index : int
        Number of the frame.
    """
    target = estimator.target
    result = estimator.estimate(image)
    search = propose_learned(prepare(estimator.setup, Observation(image)))
    frame, box = search.image.frame, target_box(target, q, t)
    held_share, large = max((_holds(r, box) for r in search.image.regions), default=(0.0, 0.0))
    offset, size = (9.0, 0.0) if search.learned is None else _beside(estimator, search.learned, q, t)
    errors = [frame_errors(q, t, h.q, h.t)[2] for h in search.hypotheses]
    nearest = int(np.argmin(errors)) if errors else -1
    x0, y0, x1, y1 = (float(v) for v in box)
    region = Region(x0, y0, x1, y1, "learned")
    height, width = image.shape
    field = edge_field(
        image,
        region.grown(0.05, width, height),
        frame.noise,
        EDGES_PX,
        background=frame.background,
        craft_probability=frame.craft_probability,
    )
    drawn = support(target, q, t, field).drawn
    source = Source(region, field)
    stays, true_score = _refined(search.image, source, q, t)
    _, e_t, E_R = frame_errors(q, t, stays.q, stays.t)
    got_q, got_t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
    if got_q is None or got_t is None:
        error, returned = (9.0, 180.0), 0.0
    else:
        _, share, deg = frame_errors(q, t, got_q, got_t)
        error, returned = (share, deg), _score_at(search.image, source, box, got_q, got_t)
    return StageRow(
        frame_index,
        float(np.linalg.norm(t)),
        held_share,
        large,
        drawn,
        offset,
        size,
        errors[nearest] if errors else 180.0,
        nearest,
        E_R,
        e_t,
        true_score,
        returned,
        error[1],
        error[0],
        result.confidence,
        result.accepted,
    )


def _holds(region: Region, box: tuple[int, int, int, int]) -> tuple[float, float]:
    """Return the share of a box inside a region, and the region's area divided by the box's."""
    x0, y0, x1, y1 = box
    wide = max(min(region.x1, x1) - max(region.x0, x0), 0.0)
    high = max(min(region.y1, y1) - max(region.y0, y0), 0.0)
    area = float(max((x1 - x0) * (y1 - y0), 1))
    return wide * high / area, (region.x1 - region.x0) * (region.y1 - region.y0) / area


def _beside(estimator: PoseEstimator, proposal: LearnedProposal, q: Array, t: Array) -> tuple[float, float]:
    """Return the distance of a location from the truth [diameters] and the ratio of the sizes."""
    target = estimator.target
    centre = t + quat.matrix(q) @ target.centre_m
    distance, f = float(np.linalg.norm(centre)), 0.5 * (target.camera.fx_px + target.camera.fy_px)
    wide = 2 * f / float(np.sqrt(max((distance / target.radius_m) ** 2 - 1.0, 1e-6)))
    offset = f * float(np.linalg.norm(proposal.crop.direction - centre / distance)) / wide
    return offset, proposal.crop.diameter_px / wide


def _refined(image: PreparedImage, source: Source, q: Array, t: Array) -> tuple[Hypothesis, float]:
    """Return a pose near the truth after refinement, and the higher score of it and the refined truth."""
    target, frame = image.setup.target, image.frame
    patch = cut_patch(target, frame, target_box(target, q, t), CLOSE_PX)
    turned = quat.rotate(q, np.array([TURN_RAD, 0.0, 0.0]))
    ends = [
        refine_to_convergence(
            target,
            frame,
            patch,
            draw_shadows(target, patch, draw(target, patch, Hypothesis(PoseFit(a, b), source))),
        )
        for a, b in ((turned, t * FARTHER), (q, t))
    ]
    return ends[0], max(e.score for e in ends)


def _score_at(
    image: PreparedImage, source: Source, box: tuple[int, int, int, int], q: Array, t: Array
) -> float:
    patch = cut_patch(image.setup.target, image.frame, box, CLOSE_PX)
    h = draw(image.setup.target, patch, Hypothesis(PoseFit(q, t), source))
    return draw_shadows(image.setup.target, patch, h).score


def main() -> None:
    """Run the study on the images of one data set."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--limit", type=int, default=None, help="number of frames, from the first")
    options = parser.parse_args()
    card = read_card(options.dataset)
    model = board_model(load_target(card.target.name))
    estimator = PoseEstimator(model, CameraIntrinsics.from_dict(msgspec.to_builtins(card.camera)))
    print("| " + " | ".join(HEAD) + " |")
    print("|" + "---|" * len(HEAD))
    rows = []
    for k in range(card.n_frames if options.limit is None else min(options.limit, card.n_frames)):
        if not is_frame_complete(options.dataset, k):
            continue
        paths = frame_paths(options.dataset, k)
        truth = read_label_record(paths.truth)
        q = np.asarray(truth.q_camera_from_target_wxyz, float)
        t = np.asarray(truth.t_camera_from_target_m, float)
        row = stage_row(estimator, grey(read_png(paths.image)), q, t, k)
        rows.append(row)
        print("| " + " | ".join(row.cells()) + " |", flush=True)
    right, accepted = sum(r.right for r in rows), sum(r.accepted for r in rows)
    wrong = sum(r.accepted and not r.right for r in rows)
    print(f"\n{right} of {len(rows)} right; {accepted} accepted, {wrong} of them wrong.")


if __name__ == "__main__":
    main()
