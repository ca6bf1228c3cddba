"""Check of the card against target and records, and of the manifest against the files."""

from __future__ import annotations

from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

from flyaround.simulator.dataset.card import CONVENTIONS, LAYOUT, CardTarget, DatasetCard
from flyaround.simulator.dataset.formats.labelled_frame import layer_ending
from flyaround.simulator.dataset.formats.native import is_frame_complete
from flyaround.simulator.dataset.record_fields import RECORD_FIELDS
from flyaround.simulator.dataset.split import SPLIT_NAME
from flyaround.simulator.dataset.storage.manifest import MANIFEST_NAME, file_hash, read_manifest
from flyaround.simulator.dataset.storage.store import FolderStore
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.threads import threads

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from flyaround.simulator.targets.model import Target

# Maximum size of a file that is read [bytes].
MAX_FILE_BYTES = 2**32
MAX_NAMED = 5  # files named per kind


def check_card(
    card: DatasetCard, target: Target | None, layers_of_frames: Sequence[tuple[str, ...]]
) -> Iterator[str]:
    """Compare the card with the target model and with the layers named in the records.

    Parameters
    ----------
    card : DatasetCard
        Card of the data set.
    target : Target or None
        Model that was drawn, if available.
    layers_of_frames : sequence of tuple of str
        Names of each frame's layers.
    """
    if target is not None:
        expected = CardTarget.from_target(target)
        if list(card.target.keypoints.items()) != list(expected.keypoints.items()):
            yield "keypoints, or their order, differ from the target's"
        for name in ("parts", "part_classes"):
            recorded = getattr(card.target, name)
            if recorded and recorded != getattr(expected, name):  # cards of earlier versions lack it
                yield f"target.{name} differ from the target's"
    own_name = card.scenario.get("name")
    if own_name and card.scenario_name != own_name:
        yield f"scenario_name is {card.scenario_name!r}, the scenario's own name {own_name!r}"
    listed = set(card.labels)
    counts = Counter(name for layers in layers_of_frames for name in layers)
    yield from (f"labels does not name {name}, which frames have" for name in sorted(set(counts) - listed))
    if layers_of_frames:
        # the last frame of a flight has no flow
        missing = listed - set(counts) - ({"flow"} if len(layers_of_frames) == 1 else set())
        yield from (f"labels names {name}, which no frame has" for name in sorted(missing))
    if card.is_of_this_version:
        for field, text in (
            ("conventions", CONVENTIONS),
            ("record_fields", RECORD_FIELDS),
            ("layout", LAYOUT),
        ):
            if getattr(card, field) != text:
                yield f"{field} differ from those of flyaround {card.machine.flyaround}"


def check_frames_listed(
    card: DatasetCard, splits: Mapping[int, str], assigned: Mapping[str, Sequence[int]], folder: Path
) -> Iterator[str]:
    """Compare the split, the quarantined frames and the sensors of the card with the files.

    Parameters
    ----------
    card : DatasetCard
        Card of the data set.
    splits : mapping
        Split of each frame number, as listed in ``split.json``.
    assigned : mapping
        Recomputed frame numbers of each split; empty if they cannot be recomputed.
    folder : Path
        Data set.
    """
    for q in card.quarantined:
        if q.frame >= card.n_frames or is_frame_complete(folder, q.frame):
            yield f"quarantined names frame {q.frame}, which is not in quarantine"
    if not card.complete:
        return
    numbers = range(card.n_frames)
    if (card.split is None) != (not splits):
        yield f"the card says split {card.split}, and {SPLIT_NAME} lists {len(splits)} frames"
    elif splits and set(splits) != set(numbers):
        first = min(set(splits) ^ set(numbers))
        yield f"{SPLIT_NAME} does not list the card's {card.n_frames} frames: frame {first} is not in both"
    elif card.is_of_this_version:
        other = [k for name, frames in assigned.items() for k in frames if splits.get(k) != name]
        if other:
            yield f"{SPLIT_NAME} has frame {other[0]} in another split than the card's ratio {card.split} gives"
    endings = ["png", "mask.png", "json", *(f"{name}.{layer_ending(name)}" for name in card.labels)]
    sensors = {f"{k:06d}.{name}.npz" for k in numbers for name in card.sensors}
    existing = {path.name for path in (folder / "images").iterdir() if not path.name.startswith(".")}
    yield from (f"images/{name} is missing" for name in sorted(sensors - existing)[:MAX_NAMED])
    unexpected = existing - sensors - {f"{k:06d}.{ending}" for k in numbers for ending in endings}
    yield from (f"images/{name} is of no frame, label or sensor" for name in sorted(unexpected)[:MAX_NAMED])


def check_manifest(
    folder: Path, card: DatasetCard, frames: Sequence[int]
) -> Iterator[tuple[int | None, str]]:
    """Compare the manifest's hashes with the files of some frames; in a complete set every file has one."""
    store = FolderStore(folder)
    try:
        manifest = read_manifest(store)
    except UserError as error:
        yield None, str(error)
        return
    if not store.exists(MANIFEST_NAME):
        return  # converted sets have none, and --resume works without
    files: dict[int, set[str]] = {k: set() for k in frames}
    for path in (folder / "images").iterdir():
        number = path.name.partition(".")[0]
        if number.isdecimal() and int(number) in files:
            files[int(number)].add(f"images/{path.name}")

    def faults(k: int) -> list[str]:
        lines = manifest.get(k, {})
        problems = []
        if card.complete:
            problems = [f"{name} is not in {MANIFEST_NAME}" for name in sorted(files[k] - set(lines))]
            problems += [f"{name} is missing" for name in sorted(set(lines) - files[k])]
        for name in sorted(files[k] & set(lines)):
            try:
                if file_hash(store.read(name, MAX_FILE_BYTES)) != lines[name]:
                    problems.append(f"{name} has another hash than in {MANIFEST_NAME}")
            except (OSError, UserError) as error:
                problems.append(f"{name} cannot be read ({error})")
        return problems

    if card.complete:
        for k in sorted(manifest.keys() - files.keys())[:MAX_NAMED]:
            yield None, f"{MANIFEST_NAME} lists frame {k}, which is missing"
    with ThreadPoolExecutor(threads()) as pool:  # hashing releases Python's lock
        for k, problems in zip(frames, pool.map(faults, frames), strict=True):
            yield from ((k, message) for message in problems)
