"""Training, validation and test split, stratified by range; appending frames does not change it."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from flyaround.simulator.dataset.formats.labelled_frame import SPLITS
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import (
    read_regular,
    refuse_deep,
    refuse_link_out,
    whole_number,
    without_mark,
)

if TYPE_CHECKING:
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame
    from flyaround.simulator.scene.state import SceneState

SPLIT_NAME = "split.json"

# Maximum size of an accepted split file [bytes].
MAX_BYTES = 200_000_000

# Maximum number in a ratio such as 8:1:1.
MAX_SHARE = 1_000_000
# Number of groups after which the shares are exact, in multiples of the sum of the ratio. More would leave each stratum
# freer to follow the ratio, fewer would make small sets exact; the splits of existing data sets depend on it.
BLOCKS_PER_EXACT_RUN = 10
# Two strata of range per octave, with edges independent of the frames.
STRATA_PER_OCTAVE = 2

Ratio = tuple[int, int, int]


def parse_split(text: str) -> Ratio:
    """Parse shares of training, validation and test frames such as ``8:1:1``.

    Returns
    -------
    tuple of int
        Three shares in lowest terms.

    Raises
    ------
    UserError
        If it is not three whole numbers up to `MAX_SHARE`, of which one is above 0.
    """
    parts = text.split(":")
    numbers = [n for word in parts if (n := whole_number(word.strip())) is not None]
    if len(parts) != 3 or len(numbers) != 3 or not any(numbers) or max(numbers) > MAX_SHARE:
        raise UserError(
            f"--split '{text[:40]}' is not three whole numbers train:validation:test of at most {MAX_SHARE}; "
            "give for example 8:1:1"
        )
    return lowest_terms(numbers)


def lowest_terms(numbers: list[int] | tuple[int, ...]) -> Ratio:
    """Return a ratio without common factors; missing numbers are 0."""
    a, b, c = (*numbers, 0, 0, 0)[:3]
    factor = math.gcd(a, b, c) or 1
    return a // factor, b // factor, c // factor


class SplitAssigner:
    """Assignment of frames to the training, validation and test splits, in the order of their numbers.

    The split of a frame depends only on earlier frames, so it does not change if the data set grows. Frames of one pair
    or one sequence form a group and stay together; any other frame is a group of its own. The shares, counted in groups
    of any length, approximate the ratio, in each stratum of range and overall. They are exact after every
    `BLOCKS_PER_EXACT_RUN` times the sum of the ratio.

    Parameters
    ----------
    ratio : tuple of int
        Ratio of training, validation and test groups.
    assigned : dict of int to str, optional
        Splits of frames that are already assigned, by number; the rest of their groups follows them.
    """

    def __init__(self, ratio: Ratio, assigned: dict[int, str] | None = None) -> None:
        self.ratio, self._assigned = ratio, assigned or {}
        total = sum(ratio)
        self._shares = [part / total for part in ratio]
        self._remaining = [0, 0, 0]
        self._totals: Counter[int] = Counter()
        self._strata: dict[int, Counter[int]] = {}
        self._groups: dict[tuple[str, int], int] = {}
        self.numbers: dict[str, list[int]] = {name: [] for name in SPLITS}
        """Frames of each split so far."""

    def assign(self, frame: LabelledFrame) -> str:
        """Return the split of the next frame."""
        group = group_of(frame)
        if frame.number in self._assigned:
            self._groups[group] = SPLITS.index(self._assigned[frame.number])
        elif group not in self._groups:
            self._groups[group] = self._choose(math.floor(math.log2(frame.range_m) * STRATA_PER_OCTAVE))
        name = SPLITS[self._groups[group]]
        self.numbers[name].append(frame.number)
        return name

    def _choose(self, stratum: int) -> int:
        if not any(self._remaining):
            self._remaining = [part * BLOCKS_PER_EXACT_RUN for part in self.ratio]
        stratum_counts = self._strata.setdefault(stratum, Counter())

        def deficit(k: int) -> float:
            return sum(
                self._shares[k] * (counts.total() + 1) - counts[k]
                for counts in (stratum_counts, self._totals)
            )

        best = max((k for k in range(3) if self._remaining[k]), key=deficit)
        self._remaining[best] -= 1
        stratum_counts[best] += 1
        self._totals[best] += 1
        return best


def group_of(frame: LabelledFrame) -> tuple[str, int]:
    """Return the group that must stay in one split: a frame's pair, its sequence, or itself."""
    scene: SceneState | None = getattr(frame.truth, "scene", None)  # an imported image has none
    sample = None if scene is None else scene.sample
    if sample and sample.pair is not None:
        return "pair", sample.pair.pair
    if sample and sample.sequence is not None:
        return "sequence", sample.sequence.sequence
    return "frame", frame.number


class SplitFile(msgspec.Struct, frozen=True, kw_only=True):
    """``split.json``: numbers of the frames of each split."""

    ratio: tuple[int, int, int]
    train: tuple[int, ...]
    validation: tuple[int, ...]
    test: tuple[int, ...]

    def by_frame(self) -> dict[int, str]:
        """Return the split of each frame.

        Raises
        ------
        UserError
            If a frame is listed twice.
        """
        listed = Counter(k for name in SPLITS for k in getattr(self, name))
        duplicated = [k for k, count in listed.items() if count > 1]
        if duplicated:
            raise UserError(
                f"{SPLIT_NAME} lists frame {duplicated[0]} twice; run capture again with --resume to rewrite it"
            )
        return {k: name for name in SPLITS for k in getattr(self, name)}


def split_file(assigner: SplitAssigner) -> bytes:
    """Return the content of ``split.json``."""
    split = SplitFile(ratio=assigner.ratio, **{name: tuple(v) for name, v in assigner.numbers.items()})
    return msgspec.json.encode(split) + b"\n"


def read_split(folder: Path) -> dict[int, str]:
    """Read the split of each frame of a data set; empty if it is not split.

    Raises
    ------
    UserError
        If ``split.json`` is there and damaged, or lists a frame twice.
    """
    path = folder / SPLIT_NAME
    if not path.exists():
        return {}
    refuse_link_out(path, folder)
    try:
        data = without_mark(read_regular(path, MAX_BYTES), str(path))
        refuse_deep(data, str(path))
        return msgspec.json.decode(data, type=SplitFile).by_frame()
    except (OSError, msgspec.DecodeError, UnicodeDecodeError) as error:
        raise UserError(
            f"{path} is damaged: {error}; run capture again with --resume to rewrite it"
        ) from error
