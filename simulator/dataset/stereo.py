"""Stereo pairs: the second camera's images of a plan, a data set in a subfolder of the first one's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.dataset.card import CARD_NAME, StereoCard
from flyaround.simulator.dataset.formats.native import frame_paths, is_frame_complete
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.runtime.untrusted_files import refuse_link_out
from flyaround.simulator.scenario.plan import DocumentPlan
from flyaround.simulator.scene.second_camera import SECOND_SEED, SecondCamera, second_camera_scene

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.scenario.recipe import Recipe
    from flyaround.simulator.scenario.scenario import Scenario
    from flyaround.simulator.scene.state import SceneState

FOLDER = "second"

# Tolerance of poses of one frame, which are only rounded [m, 1].
POSE_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False, kw_only=True)
class SecondCameraPlan(DocumentPlan):
    """The frames of a plan as seen by its second camera, of the same type."""

    plan: DocumentPlan
    second: SecondCamera

    @classmethod
    def from_plan(cls, plan: DocumentPlan, second: SecondCamera) -> SecondCameraPlan:
        """Return the plan of the second camera of ``plan``."""
        seed = plan.seed + SECOND_SEED
        return cls(
            plan=plan, second=second, target=plan.target, camera=plan.camera, seed=seed, every_s=plan.every_s
        )

    @property
    def document(self) -> Scenario | Recipe:
        """Scenario or recipe of the first camera's plan."""
        return self.plan.document

    @property
    def scenario_document(self) -> dict[str, Any]:
        """Scenario or recipe of the first camera's plan, as a document."""
        return self.plan.scenario_document

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return self.plan.n_frames

    @property
    def second_camera(self) -> SecondCamera | None:
        """None: there is no third camera."""
        return None

    def planned_scene(self, k: int) -> SceneState:
        """Return the scene of frame k."""
        return second_camera_scene(self.plan.scene(k), self.second)

    def next_scene(self, k: int) -> SceneState | None:
        """Return the scene that follows frame k's, or None."""
        following = self.plan.next_scene(k)
        return None if following is None else second_camera_scene(following, self.second)


def second_plan(plan: DocumentPlan) -> SecondCameraPlan | None:
    """Return the plan of a plan's second camera; None without one.

    Raises
    ------
    UserError
        If a light is fixed to the first camera.
    """
    if plan.second_camera is None:
        return None
    second = SecondCameraPlan.from_plan(plan, plan.second_camera)
    second.scene(0)  # raise for an impossible scene before anything is written
    return second


def stereo_card(plan: DocumentPlan) -> StereoCard | None:
    """Return the pair's geometry for the card of one of the two sets."""
    if isinstance(plan, SecondCameraPlan):
        return _card("second", plan.second)
    return None if plan.second_camera is None else _card("first", plan.second_camera)


def _card(name: str, second: SecondCamera) -> StereoCard:
    return StereoCard(
        camera="second" if name == "second" else "first",
        position_m=second.position_m,
        turn_deg=second.turn_deg,
        q_second_from_first_wxyz=second.q_second_from_first_wxyz,
    )


def second_folder(folder: Path, card: DatasetCard) -> Path | None:
    """Return the folder of the second camera's data set, whether it exists or not."""
    if card.stereo is None or card.stereo.camera != "first":
        return None
    refuse_link_out(folder / FOLDER, folder)
    return folder / FOLDER


def pair_faults(folder: Path, card: DatasetCard) -> Iterator[tuple[int | None, str]]:
    """Yield inconsistencies between the two cameras' records, by frame; each set is checked separately too."""
    second_path = second_folder(folder, card)
    if second_path is None or card.stereo is None:
        return
    if not (second_path / CARD_NAME).is_file():
        yield None, f"{second_path} is missing: the second camera's data set"
        return
    second = SecondCamera(position_m=card.stereo.position_m, turn_deg=card.stereo.turn_deg)
    for k in range(card.n_frames):
        if not (is_frame_complete(folder, k) and is_frame_complete(second_path, k)):
            if is_frame_complete(folder, k) != is_frame_complete(second_path, k):
                yield k, "only one of the two cameras has it"
            continue
        try:
            a, b = (
                read_truth(frame_paths(record_folder, k).truth) for record_folder in (folder, second_path)
            )
        except UserError as error:
            yield k, str(error)
            continue
        q, t = second.pose(a.q_camera_from_target_wxyz, a.t_camera_from_target_m)
        if a.epoch_utc != b.epoch_utc or a.exposure_s != b.exposure_s:
            yield k, "the two cameras' pictures are not of one instant"
        difference_m = np.abs(np.subtract(t, b.t_camera_from_target_m)).max()
        if (
            abs(abs(np.dot(q, b.q_camera_from_target_wxyz)) - 1) > POSE_TOLERANCE
            or difference_m > POSE_TOLERANCE
        ):
            yield (
                k,
                f"the target's poses in the two cameras differ from the pair's geometry by {difference_m:.3g} m",
            )
