"""Capture: draw frames of a plan, check each as it is written, and keep the card true at every moment."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import msgspec

from simulator.dataset.card import (
    CARD_NAME,
    CardQuarantine,
    CardTarget,
    DatasetCard,
    card_to_json,
    describe_machine,
    read_card,
)
from simulator.dataset.clipping import ClippingSummary, summarise_clipping
from simulator.dataset.drawers import open_drawer
from simulator.dataset.formats.native import is_whole, write_encoded
from simulator.dataset.formats.speed import export_speed
from simulator.dataset.lock import NAME as LOCK
from simulator.dataset.lock import only_capture
from simulator.errors import UserError
from simulator.labels.request import LAYERS, LabelRequest
from simulator.labels.truth import FlowLabel
from simulator.runtime.files import empty_folder, write_atomic

if TYPE_CHECKING:
    from collections.abc import Callable

    from simulator.camera.lens.camera_model import Camera
    from simulator.dataset.drawers import CheckedFrame
    from simulator.render.gl.context import GlInfo
    from simulator.scene.state import SceneState
    from simulator.targets.model import Target

log = logging.getLogger(__name__)

FORMATS = ("native", "speed")


class Plan(Protocol):
    """What a capture needs: frames by number, each from the plan alone, and what the card says of them."""

    @property
    def scenario_name(self) -> str:
        """Name of the scenario or recipe."""

    @property
    def scenario_document(self) -> dict[str, Any]:
        """It in full, as JSON."""

    @property
    def n_frames(self) -> int:
        """Number of frames."""

    @property
    def every_s(self) -> float | None:
        """Spacing, if it was given as one."""

    @property
    def seed(self) -> int:
        """Seed of every random choice."""

    @property
    def camera(self) -> Camera:
        """The camera."""

    @property
    def target(self) -> Target:
        """The model that is drawn."""

    def scene(self, k: int) -> SceneState:
        """The snapshot of frame k."""

    def next_scene(self, k: int) -> SceneState | None:
        """What optical flow leads to from frame k, if there is such a thing."""


@dataclass(frozen=True)
class CaptureSummary:
    """What a capture did; ``clipping`` is of the frames that it wrote, None where it wrote none with a target."""

    folder: Path
    n_written: int
    n_kept: int
    n_feasible: int
    quarantined: tuple[tuple[int, str], ...]
    clipping: ClippingSummary | None = None


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
    plan: Plan,
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
    with only_capture(folder):
        if not resume and any(path.name != LOCK for path in folder.iterdir()):
            empty_folder(folder, resume=False)
        return _capture(plan, folder, formats, labels, workers, device_index, progress, resume=resume)


def _capture(
    plan: Plan,
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
    with open_drawer(workers, device_index, plan.scene(0)) as drawer:
        card = _card(plan, drawer.info, formats, labels)
        if resume:
            card = _same_plan(folder, card)
        (folder / "images").mkdir(exist_ok=True)
        write_atomic(folder / CARD_NAME, card_to_json(card))
        kept = {k for k in range(plan.n_frames) if is_whole(folder, k)} if resume else set()
        missing = [k for k in range(plan.n_frames) if k not in kept]
        quarantined: list[tuple[int, str]] = []
        n_feasible, clipped = 0, []
        jobs = ((k, plan.scene(k), _request(plan, k, labels)) for k in missing)
        frames = drawer.frames(jobs, plan.target, card)
        for done, (k, frame) in enumerate(zip(missing, frames, strict=True)):
            if frame.reason:
                _quarantine(folder, k, frame)
                quarantined.append((k, frame.reason))
                card = _with_quarantined(card, k, frame.reason)
                write_atomic(folder / CARD_NAME, card_to_json(card))
            else:
                write_encoded(folder, k, frame.files)
                n_feasible += frame.feasible
                clipped.append(frame.clipping)
            progress(len(kept) + done + 1, plan.n_frames)
    if "speed" in card.formats:
        export_speed(folder, [k for k in range(plan.n_frames) if is_whole(folder, k)])
    write_atomic(folder / CARD_NAME, card_to_json(msgspec.structs.replace(card, complete=not quarantined)))
    n_written = len(missing) - len(quarantined)
    clipping = summarise_clipping(clipped, plan.scenario_document)
    return CaptureSummary(folder, n_written, len(kept), n_feasible, tuple(quarantined), clipping)


def _with_quarantined(card: DatasetCard, k: int, reason: str) -> DatasetCard:
    """The card with one more frame that is kept apart."""
    return msgspec.structs.replace(
        card, quarantined=(*card.quarantined, CardQuarantine(frame=k, reason=reason))
    )


def _possible(plan: Plan, labels: tuple[str, ...]) -> tuple[str, ...]:
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


def _request(plan: Plan, k: int, labels: tuple[str, ...]) -> LabelRequest:
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


def _quarantine(folder: Path, k: int, frame: CheckedFrame) -> None:
    """Write a frame whose labels disagree apart, with its reason."""
    place = folder / "quarantine"
    (place / "images").mkdir(parents=True, exist_ok=True)
    write_atomic(place / f"{k:06d}.txt", (frame.reason + "\n").encode())
    write_encoded(place, k, frame.files)
    log.warning("frame %d is quarantined: %s", k, frame.reason)


def _card(plan: Plan, info: GlInfo, formats: tuple[str, ...], labels: tuple[str, ...]) -> DatasetCard:
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
            keypoints={k.name: k.position_m for k in plan.target.keypoints},
        ),
        machine=describe_machine(info.vendor, info.renderer, info.version),
    )


def _same_plan(folder: Path, card: DatasetCard) -> DatasetCard:
    """The card to go on with: refuses to mix two plans or two renderers, keeps the formats there were."""
    if not (folder / CARD_NAME).is_file():
        if any(path.name != LOCK for path in folder.iterdir()):
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
