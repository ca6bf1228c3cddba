"""Check of the exports: each file is compared with one written again from the native frames."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from flyaround.simulator.dataset.check.export_contents import (
    LONGEST_END,
    Entry,
    entries,
    is_same,
    is_truncated,
)
from flyaround.simulator.dataset.formats.registry import BUILT_IN, NATIVE, find_format, writable
from flyaround.simulator.dataset.split import read_split
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import Truth
from flyaround.simulator.runtime.untrusted_files import read_regular, refuse_link_out

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.formats.base import DatasetFormat
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame
    from flyaround.simulator.world.frames.pose import Pose

SAMPLE_SHARE = 0.05  # share of the frames that are compared: each is read back in every format

MIN_FRAMES, MAX_SAMPLE, MAX_COMPARISONS = 4, 10, 24
"""Minimum number of compared frames, the number for few formats, and the limit on frames times formats."""

# Maximum size of an export file that is read [bytes].
MAX_BYTES = 2**30
POSE_TOLERANCE = 1e-9  # relative and absolute tolerance of a pose
LIST_SUFFIXES = (".json", ".csv")
_SHARD = re.compile(r"(.*-)\d+(\.(?:tar|parquet|mcap))")


@dataclass(frozen=True)
class ExportCheck:
    """Result of the comparison: number of compared frames of each export, faults, and skipped comparisons."""

    n_frames: int
    faults: tuple[tuple[int | None, str], ...] = ()
    not_checked: tuple[str, ...] = ()


class ExportsCheck:
    """Comparison of a data set's exports with its native frames, one frame at a time.

    The files of every frame must exist and must not be truncated. In the pose lists every row
    of a readable frame is compared, and duplicates are faults. Other contents are compared for a sample of the frames,
    or for all of them.

    Parameters
    ----------
    folder : Path
        Folder of the data set.
    card : DatasetCard
        Card of the data set.
    numbers : sequence of int
        Numbers of all intact frames.
    seed : int
        Seed of the sample.
    whole : bool
        True to compare all frames.
    """

    def __init__(
        self, folder: Path, card: DatasetCard, numbers: Sequence[int], seed: int, *, whole: bool
    ) -> None:
        self.splits: dict[int, str] = {}
        self._faults: list[tuple[int | None, str]] = []
        self._not_checked: list[str] = []
        self._sample: frozenset[int] = frozenset()
        self._comparisons: list[_Comparison] = []
        existing = [name for name in writable()[1:] if (folder / name).is_dir()]
        listed = [name for name in card.formats if name != NATIVE]
        self._faults += [
            (None, f"{name}/ exists, but the card does not name that format")
            for name in existing
            if name not in listed
        ]
        names = list(dict.fromkeys([*listed, *existing]))
        try:
            self.splits = read_split(folder)
        except UserError as error:
            self._faults.append((None, str(error)))
            return
        if not names:
            return
        if not card.complete:
            self._not_checked.append("exports are written at the end of a capture")
            return
        if not card.is_of_this_version:
            self._not_checked.append(
                f"exports were written by another version, flyaround {card.machine.flyaround}"
            )
            return
        # writers received this card at the start of the capture
        initial_card = msgspec.structs.replace(card, complete=False, quarantined=())
        for name in names:
            try:
                form = find_format(name)
                if form not in BUILT_IN:
                    self._not_checked.append(f"format {name} belongs to another package")
                    continue
                self._comparisons.append(_Comparison(form, folder / name, initial_card, is_complete=whole))
            except UserError as error:
                self._not_checked.append(str(error))
        self._sample = frozenset(numbers if whole else _sample(numbers, self.splits, seed, len(names)))

    def take(self, frame: LabelledFrame) -> None:
        """Compare the files of a frame, if it is in the sample."""
        if frame.number in self._sample:
            for comparison in self._comparisons:
                comparison.take(frame)

    def finish(self, poses: Mapping[int, Pose]) -> ExportCheck:
        """Compare the files of all frames.

        Parameters
        ----------
        poses : mapping
            Poses of all readable frames, by number.
        """
        if not poses:
            return ExportCheck(0, tuple(self._faults))
        for comparison in self._comparisons:
            comparison.finish()
            faults = [
                *comparison.faults,
                *_check_others(comparison, poses, self.splits),
                *_check_poses(comparison, poses),
            ]
            self._faults += [(k, f"{comparison.form.name}/{message}") for k, message in faults]
        return ExportCheck(len(self._sample & set(poses)), tuple(self._faults), tuple(self._not_checked))


def _sample(numbers: Sequence[int], splits: Mapping[int, str], seed: int, n_formats: int) -> list[int]:
    """Select the frames whose contents are compared, some from each split."""
    order = np.random.default_rng([seed % 2**63, len(numbers), 1]).permutation(numbers).tolist()
    fewest = min(MAX_SAMPLE, max(MIN_FRAMES, MAX_COMPARISONS // n_formats))
    selected = set(order[: max(fewest, math.ceil(SAMPLE_SHARE * len(numbers)))])
    for split in set(splits.values()):
        selected.update([k for k in order if splits.get(k) == split][:1])
    return sorted(selected)


class _Comparison:
    """A `FormatOutput` that compares each file with the existing one instead of writing it.

    Parameters
    ----------
    form : DatasetFormat
        Format of the export.
    root : Path
        Folder of the export.
    card : DatasetCard
        Card of the data set.
    is_complete : bool
        True if all frames are passed. Otherwise existing lists and shards may hold additional frames.
    """

    def __init__(self, form: DatasetFormat, root: Path, card: DatasetCard, *, is_complete: bool) -> None:
        self.form, self.root = form, root
        self.faults: list[tuple[int | None, str]] = []
        self.written: dict[int | None, list[str]] = {}
        """Names of the files of each frame, and of those for all frames."""
        self._is_whole = is_complete
        self._frame: int | None = None
        self._is_varied = False
        self._next_shard: dict[str, int] = {}
        self._writer = form.open_writer(self, card)

    def take(self, frame: LabelledFrame) -> None:
        """Compare the files of one frame."""
        self._frame, truth = frame.number, frame.truth
        self._is_varied |= isinstance(truth, Truth) and truth.scene.target.variation is not msgspec.UNSET
        try:
            self._writer.write(frame)
        except UserError as error:
            self.faults.append((frame.number, f"cannot be compared: {error}"))
        self._frame = None

    def finish(self) -> None:
        """Compare the files of all frames."""
        self._writer.finish()

    def write(self, name: str, data: bytes) -> None:
        """Compare one file."""
        self._compare_file(name, lambda: entries(name, data), data)

    def write_arrays(self, name: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Compare one file of arrays."""
        self._compare_file(name, lambda: itertools.starmap(Entry, arrays.items()))

    def _compare_file(
        self, name: str, expected_entries: Callable[[], Iterable[Entry]], data: bytes | None = None
    ) -> None:
        is_shard = _SHARD.fullmatch(name)
        frame_number = None if is_shard or name.startswith("models/") else self._frame
        self.written.setdefault(frame_number, []).append(name)
        if not self._is_whole and (
            Path(name).suffix == ".md" or (self._is_varied and name.startswith("models/"))
        ):
            return  # the text counts frames; models are numbered in order of appearance
        is_subset = frame_number is None and not self._is_whole
        for entry, message in self._compare(name, expected_entries, data, is_subset=is_subset):
            self.faults.append(
                (frame_number if entry is None or entry.frame is None else entry.frame, f"{name}: {message}")
            )

    def _compare(
        self, name: str, expected: Callable[[], Iterable[Entry]], data: bytes | None, *, is_subset: bool
    ) -> Iterator[tuple[Entry | None, str]]:
        paths, first = [self.root / name], 0
        shard = _SHARD.fullmatch(name) if is_subset else None
        if shard:
            of_split = (self.root / name).parent.glob(Path(shard[1]).name + "*" + shard[2])
            paths = sorted(p for p in of_split if _SHARD.fullmatch(p.name)) or paths
            first = self._next_shard.get(shard[1], 0)  # frames are ordered in both
        expected_entries: dict[str, Entry] | None = None
        missing: set[str] = set()
        for number, path in enumerate(paths[first:], first):
            try:
                refuse_link_out(path, self.root)
                contents = read_regular(path, MAX_BYTES)
                if contents == data:
                    return
                if expected_entries is None:
                    expected_entries = {entry.key: entry for entry in expected()}
                    missing = set(expected_entries)
                for entry in entries(name, contents):
                    if entry.key in missing:
                        missing.remove(entry.key)
                        if not is_same(
                            self._comparable(expected_entries[entry.key].value), self._comparable(entry.value)
                        ):
                            yield expected_entries[entry.key], f"{entry.key} is not the native frame's"
                    elif entry.key in expected_entries:
                        yield entry, f"{entry.key} is duplicated"
                    elif not is_subset:
                        yield entry, f"{entry.key} belongs to no native frame"
            except OSError as error:
                yield None, f"it cannot be read ({error.strerror or error})"
                return
            except (UserError, AttributeError, TypeError, ValueError) as error:
                yield None, str(error)
                return
            if shard and not missing:
                self._next_shard[shard[1]] = number
                return
        for key in sorted(missing):
            yield expected_entries[key] if expected_entries else None, f"{key} is missing"

    def _comparable(self, value: Any) -> Any:  # noqa: ANN401 - any value of a file
        """Return a name without the model numbers, which depend on earlier frames."""
        if self._is_whole or not self._is_varied or not isinstance(value, list):
            return value
        return [
            {key: v for key, v in row.items() if key != "obj_id"} if isinstance(row, dict) else row
            for row in value
        ]


def _check_others(
    comparison: _Comparison, poses: Mapping[int, Pose], splits: Mapping[int, str]
) -> Iterator[tuple[int, str]]:
    """Check that the files of frames that were not compared exist and are not truncated."""
    templates: dict[str, set[str]] = {}
    for k, names in comparison.written.items():
        if k is not None:
            own, split = {_template(name, k) for name in names}, splits.get(k, "")
            templates[split] = templates.get(split, own) & own
    for k in poses:
        if k in comparison.written:
            continue
        for template in sorted(templates.get(splits.get(k, ""), ())):
            name = template.replace("{six}", f"{k:06d}").replace("{k}", str(k))
            try:
                with (comparison.root / name).open("rb") as file:
                    length = file.seek(0, 2)
                    file.seek(max(length - LONGEST_END, 0))
                    last = file.read()
            except OSError as error:
                yield k, f"{name}: it cannot be read ({error.strerror or error})"
                continue
            if is_truncated(name, last):
                yield k, f"{name}: it is cut off"


def _template(name: str, number: int) -> str:
    folder, _, file = name.rpartition("/")
    file = re.sub(rf"^{number}_rgb", "{k}_rgb", file.replace(f"{number:06d}", "{six}", 1))
    return f"{folder}/{file}" if folder else file


def _check_poses(comparison: _Comparison, poses: Mapping[int, Pose]) -> Iterator[tuple[int | None, str]]:
    """Check every row of the lists that the format's own reader reads."""
    read = comparison.form.read
    if read is None:
        return
    listed: set[int] = set()
    for name in comparison.written.get(None, []):
        path = comparison.root / name
        if path.suffix not in LIST_SUFFIXES or not path.is_file():
            continue
        try:
            contents = read(path)
        except UserError as error:
            yield None, f"{name}: {error}"
            return
        for picture in () if contents is None else contents.pictures:
            number = re.search(r"\d+", Path(picture.name).stem)
            if number is None or int(number[0]) not in poses:
                continue
            k, pose = int(number[0]), picture.camera_from_target
            if k in listed:
                yield k, f"{name}: the frame is listed a second time"
            listed.add(k)
            if not (
                np.allclose(pose.R, poses[k].R, rtol=0, atol=POSE_TOLERANCE)
                and np.allclose(pose.t_m, poses[k].t_m, rtol=POSE_TOLERANCE, atol=POSE_TOLERANCE)
            ):
                yield k, f"{name}: the pose differs from that of the native frame"
    for k in poses:
        if k not in listed:
            yield k, ": no list has a pose of the frame"
