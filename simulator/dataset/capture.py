"""Capture: draw frames of a plan, verify each before it is written, and keep the card consistent at all times."""

from __future__ import annotations

from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import msgspec

from flyaround.simulator.dataset.card import CARD_NAME, CardTarget, DatasetCard, describe_machine
from flyaround.simulator.dataset.clipping import ClippingSummary, summarise_clipping
from flyaround.simulator.dataset.exports import ExportSink
from flyaround.simulator.dataset.formats.registry import check_formats
from flyaround.simulator.dataset.ray_frames import RayCluster, RayFrames
from flyaround.simulator.dataset.resume import ExistingFrames, card_to_resume, inspect_frames
from flyaround.simulator.dataset.split import Ratio, lowest_terms
from flyaround.simulator.dataset.stereo import FOLDER as SECOND_FOLDER
from flyaround.simulator.dataset.stereo import second_plan, stereo_card
from flyaround.simulator.dataset.storage.space import frame_bytes, require_disk_space
from flyaround.simulator.dataset.storage.store import FolderStore, Store
from flyaround.simulator.dataset.storage.url_store import UrlStore, is_url
from flyaround.simulator.dataset.writer import CheckAndEncode, DatasetWriter
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.request import LAYERS, LabelRequest
from flyaround.simulator.labels.truth import FlowLabel
from flyaround.simulator.loop import open_frames, run_frames
from flyaround.simulator.runtime.files import empty_folder
from flyaround.simulator.runtime.folder_lock import lock_name, only_writer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from contextlib import AbstractContextManager

    from flyaround.simulator.dataset.writer import CheckedFrame
    from flyaround.simulator.loop import FrameProducer
    from flyaround.simulator.scenario.plan import DocumentPlan, FramePlan


@dataclass(frozen=True)
class CaptureSummary:
    """Result of a capture; ``clipping`` covers the frames written, None if none shows a target.

    Parameters
    ----------
    folder : Path or str
        Folder or URL of the data set.
    n_written : int
        Number of frames written.
    n_kept : int
        Number of frames that existed and were kept.
    n_feasible : int
        Number of the written frames that are feasible.
    quarantined : tuple of tuple of int and str
        Number and first fault of each frame whose labels contradict its scene.
    clipping : ClippingSummary, optional
        Saturation of the written frames; None if none shows a target.
    redraws : dict, optional
        Number of poses drawn again in these frames, for each of the recipe's constraints.
    damaged : tuple of int, optional
        Existing frames that differed from their record, and were rendered again.
    second : CaptureSummary, optional
        Summary of the second camera's data set, if the plan has one.
    """

    folder: Path | str
    n_written: int
    n_kept: int
    n_feasible: int
    quarantined: tuple[tuple[int, str], ...]
    clipping: ClippingSummary | None = None
    redraws: dict[str, int] = dataclass_field(default_factory=dict)
    damaged: tuple[int, ...] = ()
    second: CaptureSummary | None = None


def capture(
    plan: DocumentPlan,
    folder: str | Path,
    *,
    formats: tuple[str, ...] = ("native",),
    labels: tuple[str, ...] | None = None,
    sensors: tuple[str, ...] = (),
    split: Ratio | None = None,
    extra_files: Mapping[str, bytes] = MappingProxyType({}),
    resume: bool = False,
    workers: int = 1,
    cluster: RayCluster | None = None,
    device_index: int | None = None,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
    tell: Callable[[str], None] = lambda _sentence: None,
) -> CaptureSummary:
    """Capture all frames of a plan into a data set.

    Each frame is checked before it is written. A frame with inconsistent labels is written to ``quarantine/``, together
    with the reason. The images of a second camera go to ``second/``, a separate data set with the same frame numbers.
    An interrupted capture is a valid data set. With ``resume`` it continues: existing frames are verified, damaged ones
    are drawn again, and the plan may have more frames than before.

    Parameters
    ----------
    plan : DocumentPlan
        Frames to capture.
    folder : str or Path
        Folder, or URL of an fsspec store such as ``s3://bucket/set``.
    formats : tuple of str, optional
        Formats to write next to the native layout; see ``flyaround.simulator.dataset.formats.registry``.
    labels : tuple of str, optional
        Layers besides truth and mask, out of ``flyaround.simulator.labels.request.LAYERS``; by default the plan's own.
    sensors : tuple of str, optional
        Plug-in sensors whose measurements of each frame are stored next to its image (docs/plugins.md).
    split : tuple of int, optional
        Shares of training, validation and test frames; by default a recipe's own.
    extra_files : mapping, optional
        Further files by name, written next to the card before the first frame.
    resume : bool, optional
        True to resume an interrupted capture.
    workers : int, optional
        Number of processes that draw, check and encode, each with its own renderer; the bytes do not depend on it.
    cluster : RayCluster, optional
        Ray cluster that draws instead; its frames are written here.
    device_index : int, optional
        EGL device to render on; None for the driver's choice.
    progress : callable, optional
        Called with the number of finished frames, and the total.
    tell : callable, optional
        Called before anything is drawn, with one sentence per format that lists the omitted labels.

    Returns
    -------
    CaptureSummary
        Numbers of written and quarantined frames, with the reasons.

    Raises
    ------
    UserError
        If the folder is not empty (without ``resume``), belongs to another plan, cannot be written, has too little
        room, another capture is writing into it, or a format cannot hold such frames.
    """
    labels = _possible_layers(plan, plan.labels if labels is None else labels)
    second_camera_plan = second_plan(plan)
    planned = capture_card(plan, formats, labels, split, sensors)
    for sentence in check_formats(formats, planned):
        tell(sentence)
    with _store_for(folder, resume=resume) as store:
        open_producer = partial(_open_producer, workers=workers, device_index=device_index, cluster=cluster)
        summary = _capture(plan, store, planned, open_producer, extra_files, progress, resume=resume)
        if second_camera_plan is None:
            return summary
        second = capture(
            second_camera_plan,
            f"{folder}/{SECOND_FOLDER}",
            formats=formats,
            labels=labels,
            sensors=sensors,
            split=split,
            resume=resume,
            workers=workers,
            cluster=cluster,
            device_index=device_index,
            progress=progress,
        )
        return replace(summary, second=second)


@contextmanager
def _store_for(output: str | Path, *, resume: bool) -> Iterator[Store]:
    """Open the store of a new data set, or of one to resume; a folder is locked for this capture."""
    if is_url(output):
        with closing(UrlStore(str(output))) as remote:
            if not resume and not remote.is_empty():
                raise UserError(
                    f"{remote.title} is not empty; name a new place with -o, or continue it with --resume"
                )
            yield remote
        return
    is_new = not Path(output).exists()
    folder = empty_folder(Path(output), resume=True)
    try:
        with only_writer(folder, "capture"):
            store = FolderStore(folder, frozenset({lock_name("capture")}))
            if not resume and not store.is_empty():
                empty_folder(folder, resume=False)
            yield store
    finally:
        if is_new:
            # if the capture failed before its first file, remove the empty folder
            with suppress(OSError):
                folder.rmdir()


def _capture(
    plan: DocumentPlan,
    store: Store,
    planned: DatasetCard,
    open_producer: Callable[[DocumentPlan, DatasetCard], AbstractContextManager[FrameProducer[CheckedFrame]]],
    extra_files: Mapping[str, bytes],
    progress: Callable[[int, int], None],
    *,
    resume: bool,
) -> CaptureSummary:
    """Run `capture` on a store that is locked for it."""
    labels, formats = planned.labels, planned.formats
    # count existing frames once the plan is known to be the same
    if not (resume and store.exists(CARD_NAME)):
        _require_disk_space(store, plan, labels, formats, plan.n_frames)
    with open_producer(plan, planned) as producer:
        info = producer.info
        card = msgspec.structs.replace(
            planned, machine=describe_machine(info.vendor, info.renderer, info.version)
        )
        existing = ExistingFrames(frozenset())
        if resume:
            card, old = card_to_resume(store, card)
            if old is not None:
                existing = inspect_frames(store, plan, old)
                _require_disk_space(store, plan, labels, formats, plan.n_frames - len(existing.kept))
        missing = [k for k in range(plan.n_frames) if k not in existing.kept]
        with DatasetWriter(store, card) as writer:
            if extra_files:
                store.write(list(extra_files.items()))
            exports = ExportSink(store, card, card.split, existing.kept)
            frames = run_frames(
                plan, producer, [writer, exports], labels=lambda k: _request(plan, k, labels), numbers=missing
            )
            for n_done, _ in enumerate(frames, start=len(existing.kept) + 1):
                progress(n_done, plan.n_frames)
            writer.flush()
            exports.finish()
            writer.finish()
    n_written = len(missing) - len(writer.quarantined)
    clipping = summarise_clipping(writer.clipping, plan.scenario_document)
    return CaptureSummary(
        store.folder if isinstance(store, FolderStore) else store.title,
        n_written,
        len(existing.kept),
        writer.n_feasible,
        tuple(writer.quarantined),
        clipping,
        dict(writer.redraws),
        existing.damaged,
    )


def _open_producer(
    plan: FramePlan, card: DatasetCard, *, workers: int, device_index: int | None, cluster: RayCluster | None
) -> AbstractContextManager[FrameProducer[CheckedFrame]]:
    """Open the producer that draws, verifies and encodes a plan's frames: in this process, in several, or on a Ray
    cluster.
    """
    first = plan.scene(0)
    if cluster is not None:
        stage = CheckAndEncode(card, plan.target)
        return RayFrames(stage, cluster, first=first, target=plan.target, n_frames=plan.n_frames)
    return open_frames(
        # other local processes are sent only the target's name
        CheckAndEncode(card, plan.target if workers == 1 else None),
        # one process draws here; several have a renderer each
        processes=workers if workers > 1 else 0,
        device_index=device_index,
        first=first,
        target=plan.target,
    )


def _require_disk_space(
    store: Store, plan: DocumentPlan, labels: tuple[str, ...], formats: tuple[str, ...], n_frames: int
) -> None:
    exports = len([name for name in formats if name != "native"])
    require_disk_space(store, n_frames, frame_bytes(plan.scene(0), labels, exports))


def _possible_layers(plan: DocumentPlan, labels: tuple[str, ...]) -> tuple[str, ...]:
    """Return the layers that the plan's frames can have; ``all`` omits optical flow if there is none."""
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


def _request(plan: DocumentPlan, k: int, labels: tuple[str, ...]) -> LabelRequest:
    """Return the label request of frame k; the last frame of a flight has no optical flow."""
    following = plan.next_scene(k) if "flow" in labels else None
    if following is None:
        return LabelRequest(layers=labels)
    flow = FlowLabel(
        t_s=following.t_s,
        q_camera_from_target_wxyz=following.q_camera_from_target_wxyz,
        t_camera_from_target_m=following.t_camera_from_target_m,
    )
    return LabelRequest(layers=labels, flow=flow)


def capture_card(
    plan: DocumentPlan,
    formats: tuple[str, ...],
    labels: tuple[str, ...],
    split: Ratio | None,
    sensors: tuple[str, ...],
) -> DatasetCard:
    """Return the card of a planned capture, before the renderer exists.

    Returns
    -------
    DatasetCard
        Card marked incomplete, without quarantined frames and without the driver's name and version; its formats begin
        with ``native``.
    """
    return DatasetCard(
        scenario_name=plan.scenario_name,
        scenario=plan.scenario_document,
        seed=plan.seed,
        n_frames=plan.n_frames,
        every_s=plan.every_s,
        complete=False,
        formats=tuple(dict.fromkeys(("native", *formats))),
        labels=labels,
        sensors=sensors,
        split=split or _own_split(plan),
        camera=plan.camera,
        image_bits=plan.scene(0).sensor.bits,
        target=CardTarget.from_target(plan.target),
        machine=describe_machine("", "", ""),
        stereo=stereo_card(plan),
    )


def _own_split(plan: DocumentPlan) -> Ratio | None:
    """Return the split of a recipe, or None."""
    counts = plan.scenario_document.get("split") or ()
    return lowest_terms([int(n) for n in counts]) if counts else None
