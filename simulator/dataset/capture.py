"""Capture: draw frames of a plan, check each as it is written, and keep the card true at every moment."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field as dataclass_field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import msgspec

from simulator.dataset.card import CARD_NAME, CardTarget, DatasetCard, describe_machine, read_card
from simulator.dataset.clipping import ClippingSummary, summarise_clipping
from simulator.dataset.formats.native import is_whole
from simulator.dataset.formats.speed import export_speed
from simulator.dataset.writer import CheckAndEncode, DatasetWriter
from simulator.errors import UserError
from simulator.labels.part_classes import part_class
from simulator.labels.request import LAYERS, LabelRequest
from simulator.labels.truth import FlowLabel
from simulator.loop import open_frames, run_frames
from simulator.runtime.files import empty_folder
from simulator.runtime.folder_lock import lock_name, only_writer
from simulator.scenario.plan import FramePlan

if TYPE_CHECKING:
    from collections.abc import Callable

    from simulator.camera.lens.camera_model import Camera
    from simulator.scene.state import SceneState


FORMATS = ("native", "speed")


class CapturePlan(FramePlan, Protocol):
    """What a capture needs: frames by number, each from the plan alone, and what the card says of them."""

    @property
    def scenario_name(self) -> str:
        """Name of the scenario or recipe."""

    @property
    def scenario_document(self) -> dict[str, Any]:
        """It in full, as JSON."""

    @property
    def every_s(self) -> float | None:
        """Spacing, if it was given as one."""

    @property
    def seed(self) -> int:
        """Seed of every random choice."""

    @property
    def camera(self) -> Camera:
        """The camera."""

    def next_scene(self, k: int) -> SceneState | None:
        """What optical flow leads to from frame k, if there is such a thing."""


@dataclass(frozen=True)
class CaptureSummary:
    """What a capture did; ``clipping`` is of the frames that it wrote, None where it wrote none with a target.

    ``redraws`` of these frames: how many poses were drawn again for which of the recipe's constraints.
    """

    folder: Path
    n_written: int
    n_kept: int
    n_feasible: int
    quarantined: tuple[tuple[int, str], ...]
    clipping: ClippingSummary | None = None
    redraws: dict[str, int] = dataclass_field(default_factory=dict)


def parse_formats(text: str) -> tuple[str, ...]:
    """Formats from a comma-separated list.

    Raises
    ------
    UserError
        If one is unknown.
    """
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    if not names:
        raise UserError(f"--format '{text}' names no data-set format; choose from {', '.join(FORMATS)}")
    for name in names:
        if name not in FORMATS:
            raise UserError(f"unknown data-set format '{name}' in --format; choose from {', '.join(FORMATS)}")
    return names


def capture(
    plan: CapturePlan,
    folder: str | Path,
    *,
    formats: tuple[str, ...] = ("native",),
    labels: tuple[str, ...] = (),
    resume: bool = False,
    workers: int = 1,
    device_index: int | None = None,
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> CaptureSummary:
    """Take all frames of a plan into a data set.

    Each frame is checked before it is written; one whose labels disagree goes to ``quarantine/`` with its
    reason and is never silently kept. An interrupted capture is valid as far as it went and goes on with
    ``resume``.

    Parameters
    ----------
    labels : layers beyond truth and mask, out of ``simulator.labels.request.LAYERS``.
    workers : processes that draw, check and encode, each with a renderer of its own; the bytes do not depend on it.

    Raises
    ------
    UserError
        If the folder is not empty (without ``resume``), belongs to another plan, cannot be written, or another capture
        is writing into it.
    """
    folder = Path(folder)
    labels = _possible(plan, labels)
    empty_folder(folder, resume=True)
    with only_writer(folder, "capture"):
        if not resume and any(path.name != lock_name("capture") for path in folder.iterdir()):
            empty_folder(folder, resume=False)
        return _capture(plan, folder, formats, labels, workers, device_index, progress, resume=resume)


def _capture(
    plan: CapturePlan,
    folder: Path,
    formats: tuple[str, ...],
    labels: tuple[str, ...],
    workers: int,
    device_index: int | None,
    progress: Callable[[int, int], None],
    *,
    resume: bool,
) -> CaptureSummary:
    """`capture` into a folder that is this one's alone."""
    planned = _card(plan, formats, labels)
    with open_frames(
        CheckAndEncode(planned, plan.target if workers == 1 else None),
        # one draws here; more have each a renderer of their own
        processes=workers if workers > 1 else 0,
        device_index=device_index,
        first=plan.scene(0),
        target=plan.target,
    ) as producer:
        info = producer.info
        card = msgspec.structs.replace(
            planned, machine=describe_machine(info.vendor, info.renderer, info.version)
        )
        if resume:
            card = _same_plan(folder, card)
        writer = DatasetWriter(folder, card)
        kept = {k for k in range(plan.n_frames) if is_whole(folder, k)} if resume else set()
        missing = [k for k in range(plan.n_frames) if k not in kept]
        frames = run_frames(
            plan, producer, [writer], labels=lambda k: _request(plan, k, labels), numbers=missing
        )
        for done, _ in enumerate(frames, start=len(kept) + 1):
            progress(done, plan.n_frames)
    if "speed" in writer.card.formats:
        export_speed(folder, [k for k in range(plan.n_frames) if is_whole(folder, k)])
    writer.finish()
    n_written = len(missing) - len(writer.quarantined)
    clipping = summarise_clipping(writer.clipping, plan.scenario_document)
    return CaptureSummary(
        folder,
        n_written,
        len(kept),
        writer.n_feasible,
        tuple(writer.quarantined),
        clipping,
        dict(writer.redraws),
    )


def _possible(plan: CapturePlan, labels: tuple[str, ...]) -> tuple[str, ...]:
    """The layers that the plan's frames can have: of ``all``, optical flow is left out where there is none."""
    if "flow" not in labels:
        return labels
    reason = ""
    if plan.n_frames > 1 and plan.next_scene(0) is None:
        reason = f"{plan.scenario_name} draws independent samples, which have no next frame"
    elif plan.scene(0).shutter.is_rolling:
        reason = "it is defined between two instants, and a rolling shutter's rows have each their own"
    if reason and len(labels) < len(LAYERS):
        raise UserError(f"--labels flow is not possible: {reason}; leave it out")
    return tuple(name for name in labels if name != "flow") if reason else labels


def _request(plan: CapturePlan, k: int, labels: tuple[str, ...]) -> LabelRequest:
    """What to label of frame k; the last frame of a flight leads nowhere."""
    following = plan.next_scene(k) if "flow" in labels else None
    if following is None:
        return LabelRequest(layers=labels)
    flow = FlowLabel(
        t_s=following.t_s,
        q_camera_from_target_wxyz=following.q_camera_from_target_wxyz,
        t_camera_from_target_m=following.t_camera_from_target_m,
    )
    return LabelRequest(layers=labels, flow=flow)


def _card(plan: CapturePlan, formats: tuple[str, ...], labels: tuple[str, ...]) -> DatasetCard:
    """The card as planned, before it is known what draws."""
    return DatasetCard(
        scenario_name=plan.scenario_name,
        scenario=plan.scenario_document,
        seed=plan.seed,
        n_frames=plan.n_frames,
        every_s=plan.every_s,
        complete=False,
        formats=tuple(dict.fromkeys(("native", *formats))),
        labels=labels,
        camera=plan.camera,
        target=CardTarget(
            name=plan.target.name,
            sha256=plan.target.sha256,
            parts=tuple(part.name for part in plan.target.parts),
            part_classes=tuple(part_class(part.name) for part in plan.target.parts),
            keypoints={k.name: k.position_m for k in plan.target.keypoints},
        ),
        machine=describe_machine("", "", ""),
    )


def _same_plan(folder: Path, card: DatasetCard) -> DatasetCard:
    """The card to go on with: refuses to mix two plans or two renderers, keeps the formats there were."""
    if not (folder / CARD_NAME).is_file():
        if any(path.name != lock_name("capture") for path in folder.iterdir()):
            raise UserError(
                f"{folder} is not empty and has no {CARD_NAME} to go on from; name a new folder with -o"
            )
        return card
    old = read_card(folder)
    for field in ("scenario", "seed", "n_frames", "every_s", "camera", "target", "labels"):
        if getattr(old, field) != getattr(card, field):
            which = "another " + field
            if field == "labels":
                which = (
                    f"other labels ({','.join(old.labels) or 'none'}, here {','.join(card.labels) or 'none'})"
                )
            raise UserError(
                f"{folder} was captured with {which}; resume with the same command, or name a new folder"
            )
    for field in ("gl_renderer", "gl_version", "flyaround"):
        if getattr(old.machine, field) != getattr(card.machine, field):
            raise UserError(
                f"{folder} was captured with {field} {getattr(old.machine, field)}, here it is "
                f"{getattr(card.machine, field)}; go on where it began, or name a new folder"
            )
    return msgspec.structs.replace(card, formats=tuple(dict.fromkeys((*old.formats, *card.formats))))
