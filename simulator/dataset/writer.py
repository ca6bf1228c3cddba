"""The sink that writes a data set, and the preceding stage, which verifies and encodes each frame."""

from __future__ import annotations

import logging
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Self

import msgspec

from flyaround.simulator.dataset.card import CARD_NAME, CardQuarantine, DatasetCard, card_to_json
from flyaround.simulator.dataset.check.verify import check_frame
from flyaround.simulator.dataset.clipping import Clipping, measure_clipping
from flyaround.simulator.dataset.formats.native import EncodedFrame, encode_frame, frame_files
from flyaround.simulator.dataset.sensors import measurements
from flyaround.simulator.dataset.storage.batches import FrameBatches, FrameFiles
from flyaround.simulator.dataset.storage.manifest import manifest_lines, sort_manifest
from flyaround.simulator.targets.model import Target

if TYPE_CHECKING:
    from flyaround.simulator.dataset.storage.store import Store
    from flyaround.simulator.frame import Frame

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class CheckedFrame:
    """A frame ready to be written: its files, its feasibility, and the faults of its labels, if any.

    Parameters
    ----------
    number : int
        Number of the frame.
    files : EncodedFrame
        Contents of its files.
    feasible : bool
        True if the frame is feasible.
    reason : str
        First fault of its labels; empty if there is none.
    clipping : Clipping
        Saturation of the frame.
    manifest : bytes
        Lines with the hashes of the files.
    redraws : dict, optional
        Number of poses drawn again for each constraint of a recipe.
    """

    number: int
    files: EncodedFrame
    feasible: bool
    reason: str
    clipping: Clipping
    manifest: bytes
    redraws: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class CheckAndEncode:
    """The stage before a `DatasetWriter`: verifies a frame's labels independently, and encodes its files.

    Parameters
    ----------
    card : DatasetCard
        Card with which the labels must agree.
    target : Target, optional
        Rendered model; None in another process, which is sent only its name.
    """

    card: DatasetCard
    target: Target | None = None

    def __call__(self, frame: Frame) -> CheckedFrame:
        """Return the frame's files and the faults of its labels."""
        if frame.truth is None or frame.mask is None:
            raise RuntimeError("a captured frame needs labels")
        target = frame.scene.target.drawn(self.target)
        # encode in a second thread: compressing a noisy image takes long, and releases Python's global lock
        with ThreadPoolExecutor(1, thread_name_prefix="flyaround-encoder") as encoder:
            encoding = encoder.submit(encode_frame, frame)
            faults = check_frame(
                frame.number, frame.truth, frame.image, frame.mask, self.card, target, frame.layers
            )
            files = encoding.result()
        files = replace(files, sensors=measurements(frame, self.card.sensors))
        sample = frame.scene.sample
        return CheckedFrame(
            frame.number,
            files,
            frame.truth.feasible,
            "; ".join(faults),
            measure_clipping(frame),
            manifest_lines(frame_files(frame.number, files)),
            {} if isinstance(sample, msgspec.UnsetType) else sample.redraws,
        )


class DatasetWriter:
    """Writer of verified frames into a store. It quarantines faulty frames and keeps the card consistent.

    Use as a context manager: leaving it, for whatever reason, writes the remaining frames.

    Parameters
    ----------
    store : Store
        Store that receives the files.
    card : DatasetCard
        Card of the data set, written at once and marked incomplete.
    """

    def __init__(self, store: Store, card: DatasetCard) -> None:
        self._store, self.card = store, card
        self.quarantined: list[tuple[int, str]] = []
        self.clipping: list[Clipping] = []
        self.n_feasible = 0
        self.redraws: Counter[str] = Counter()
        self._batches = FrameBatches(store)
        self._write_card()

    def write(self, frame: CheckedFrame) -> None:
        """Write one frame, at the latest when the `with` block ends."""
        if frame.reason:
            self._quarantine(frame)
            return
        *parts, record = frame_files(frame.number, frame.files)
        self._batches.add(FrameFiles(parts, record, frame.manifest))
        self.n_feasible += frame.feasible
        self.clipping.append(frame.clipping)
        self.redraws.update(frame.redraws)

    def flush(self) -> None:
        """Flush all frames so far to the disk."""
        self._batches.flush()

    def finish(self) -> None:
        """Mark the card complete, unless frames are quarantined."""
        self.flush()
        sort_manifest(self._store)
        self.card = msgspec.structs.replace(self.card, complete=not self.quarantined)
        self._write_card()

    def __enter__(self) -> Self:
        self._batches.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._batches.__exit__(*error)

    def _write_card(self) -> None:
        self._store.write([(CARD_NAME, card_to_json(self.card))])

    def _quarantine(self, frame: CheckedFrame) -> None:
        """Write a frame whose labels disagree to quarantine, with its reason."""
        reason = (f"{frame.number:06d}.txt", (frame.reason + "\n").encode())
        files = [reason, *frame_files(frame.number, frame.files)]
        self._store.write([(f"quarantine/{name}", data) for name, data in files])
        log.warning("frame %d is quarantined: %s", frame.number, frame.reason)
        self.quarantined.append((frame.number, frame.reason))
        quarantined = CardQuarantine(frame=frame.number, reason=frame.reason)
        self.card = msgspec.structs.replace(self.card, quarantined=(*self.card.quarantined, quarantined))
        self._write_card()
