"""Resumption of an interrupted capture: checks that the plan is the same, and finds the intact frames."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.simulator.dataset.card import CARD_NAME, MAX_BYTES, DatasetCard, decode_card
from flyaround.simulator.dataset.formats.native import (
    frame_paths,
    is_frame_complete,
    layer_path,
    read_layer,
    read_png,
)
from flyaround.simulator.dataset.storage.manifest import file_hash, read_manifest, rewrite_manifest
from flyaround.simulator.dataset.storage.store import FolderStore
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.layers import layer_hash, pixel_hash
from flyaround.simulator.labels.truth import Truth, read_truth
from flyaround.simulator.runtime.threads import threads
from flyaround.simulator.runtime.untrusted_files import refuse_deep

if TYPE_CHECKING:
    from flyaround.simulator.dataset.storage.store import Store
    from flyaround.simulator.scenario.plan import FramePlan

# Maximum size of a file that is read [bytes].
MAX_FILE_BYTES = 2**32


@dataclass(frozen=True)
class ExistingFrames:
    """Frames that an earlier capture left in a data set.

    Parameters
    ----------
    kept : frozenset of int
        Intact frames.
    damaged : tuple of int, optional
        Altered frames, whose records were removed; they are rendered again.
    """

    kept: frozenset[int]
    damaged: tuple[int, ...] = ()


def card_to_resume(store: Store, card: DatasetCard) -> tuple[DatasetCard, DatasetCard | None]:
    """Return the card with which to continue, and the existing card, or None for a new data set.

    Raises
    ------
    UserError
        If the existing set has another plan, renderer, or more frames than requested.
    """
    if not store.exists(CARD_NAME):
        if not store.is_empty():
            raise UserError(
                f"{store.title} is not empty and has no {CARD_NAME} to continue from; name a new folder with -o"
            )
        return card, None
    try:
        old = decode_card(store.read(CARD_NAME, MAX_BYTES), f"{store.title}/{CARD_NAME}")
    except OSError as error:
        raise UserError(
            f"{store.title}: cannot read {CARD_NAME} ({error.strerror or error}); name a new folder with -o"
        ) from error
    # before parsing: scenarios of other versions may have other keys
    for field in ("gl_renderer", "gl_version", "flyaround"):
        if getattr(old.machine, field) != getattr(card.machine, field):
            raise UserError(
                f"{store.title} was captured with {field} {getattr(old.machine, field)}, here it is "
                f"{getattr(card.machine, field)}; continue there, or name a new folder"
            )
    for field in ("scenario", "seed", "every_s", "camera", "target", "labels", "sensors"):
        if getattr(old, field) != getattr(card, field):
            difference = "another " + field
            if field == "labels":
                difference = (
                    f"other labels ({','.join(old.labels) or 'none'}, here {','.join(card.labels) or 'none'})"
                )
            raise UserError(
                f"{store.title} was captured with {difference}; resume with the same command, or name a new folder"
            )
    if card.n_frames < old.n_frames:
        raise UserError(
            f"{store.title} is a data set of {old.n_frames} frames, and {card.n_frames} are requested; resume with "
            f"-n {old.n_frames} or more, or name a new folder"
        )
    if card.split and old.split and card.split != old.split:
        old_split, new_split = (":".join(map(str, ratio)) for ratio in (old.split, card.split))
        raise UserError(
            f"{store.title} was captured with --split {old_split}, here it is {new_split}; resume with the same"
        )
    formats = tuple(dict.fromkeys((*old.formats, *card.formats)))
    return msgspec.structs.replace(card, formats=formats, split=card.split or old.split), old


def inspect_frames(store: Store, plan: FramePlan, old: DatasetCard) -> ExistingFrames:
    """Find the intact frames of a data set, and remove the records of damaged ones.

    A frame is verified by the manifest's hashes; if it is not listed there, by the pixel hashes in its record.

    Raises
    ------
    UserError
        If more frames are requested than before, and the existing ones would change.
    """
    manifest = read_manifest(store)
    with ThreadPoolExecutor(threads()) as pool:  # hashing releases Python's lock
        states = list(pool.map(lambda k: _is_intact(store, k, manifest.get(k, {})), range(old.n_frames)))
    intact_frames = [k for k, intact in enumerate(states) if intact]
    if old.n_frames < plan.n_frames:
        _require_same_frames(store, plan, old, [intact_frames[0], intact_frames[-1]] if intact_frames else [])
        last = old.n_frames - 1
        if "flow" in old.labels and intact_frames and intact_frames[-1] == last:
            intact_frames.pop()  # formerly the last frame, it had no optical flow; now it has a next frame
    store.remove_unfinished()
    damaged = tuple(k for k, intact in enumerate(states) if intact is False)
    for k in damaged:
        store.remove(_record_name(k))
    hashes_by_frame = {k: hashes for k in intact_frames if _record_name(k) in (hashes := manifest.get(k, {}))}
    rewrite_manifest(
        store, hashes_by_frame | {k: _hashes(store, k) for k in intact_frames if k not in hashes_by_frame}
    )
    return ExistingFrames(frozenset(intact_frames), damaged)


def _record_name(k: int) -> str:
    """Return the name of frame k's record."""
    return f"images/{k:06d}.json"


def _is_intact(store: Store, k: int, hashes: dict[str, str]) -> bool | None:
    """Return True if frame k is intact, False if it is damaged, None if it is incomplete."""
    if not store.exists(_record_name(k)):
        # the record may also have been lost: both cases are rendered again
        return None
    if _record_name(k) in hashes:
        return all(_has_hash(store, name, digest) for name, digest in hashes.items())
    return isinstance(store, FolderStore) and _matches_record(store.folder, k)


def _has_hash(store: Store, name: str, digest: str) -> bool:
    try:
        return file_hash(store.read(name, MAX_FILE_BYTES)) == digest
    except (OSError, UserError):
        return False


def _matches_record(folder: Path, k: int) -> bool:
    """Return True if image, mask and layers have the record's hashes, and there are no other files."""
    if not is_frame_complete(folder, k):
        return False
    paths = frame_paths(folder, k)
    try:
        truth = read_truth(paths.truth)
        if {folder / name for name in _file_names(truth, k)} != set((folder / "images").glob(f"{k:06d}.*")):
            return False
        mask = np.asarray(read_png(paths.mask), np.uint8)
        return (
            pixel_hash(read_png(paths.image)) == truth.image_sha256
            and pixel_hash(mask) == truth.mask_sha256
            and all(
                layer_hash(name, read_layer(folder / "images", f"{k:06d}", name), mask) == digest
                for name, digest in truth.layer_sha256.items()
            )
        )
    except UserError:
        return False


def _file_names(truth: Truth, k: int) -> list[str]:
    """Return the names of the files that a frame's record lists, in the order of the manifest."""
    paths = frame_paths(Path(), k)
    layers = [layer_path(Path("images"), f"{k:06d}", name) for name in truth.layer_sha256]
    return [path.as_posix() for path in (paths.image, paths.mask, *layers, paths.truth)]


def _hashes(store: Store, k: int) -> dict[str, str]:
    """Return the manifest's hashes of a frame that agrees with its record."""
    truth = msgspec.json.decode(store.read(_record_name(k), MAX_BYTES), type=Truth)
    return {name: file_hash(store.read(name, MAX_FILE_BYTES)) for name in _file_names(truth, k)}


def _require_same_frames(store: Store, plan: FramePlan, old: DatasetCard, frames: list[int]) -> None:
    """Raise if a larger number of frames would change the existing ones, as when they are spread over a flight."""
    for k in frames:
        source = f"{store.title}/{_record_name(k)}"
        try:
            data = store.read(_record_name(k), MAX_BYTES)
            refuse_deep(data, source)
            scene = msgspec.json.decode(data, type=Truth).scene
        except (OSError, msgspec.DecodeError, RecursionError) as error:
            raise UserError(f"cannot read {source} ({error}); name a new folder with -o") from error
        if scene != plan.scene(k):
            raise UserError(
                f"{store.title} has {old.n_frames} frames spread over the flight, and {plan.n_frames} frames would "
                f"have other times; resume with -n {old.n_frames}, use --every, or name a new folder"
            )
