"""Splits: the ratio holds, in each stratum of range too; a larger data set keeps it; what belongs together stays so."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from flyaround.simulator.dataset.card import DatasetCard
from flyaround.simulator.dataset.record_fields import RECORD_FIELDS
from flyaround.simulator.dataset.split import SplitAssigner, lowest_terms, parse_split
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.imported import ImportedTruth
from flyaround.simulator.labels.truth import Truth


def frame(number, range_m, **sample):
    known = SimpleNamespace(pair=None, sequence=None, **sample) if not sample else SimpleNamespace(**sample)
    return SimpleNamespace(
        number=number, range_m=range_m, truth=SimpleNamespace(scene=SimpleNamespace(sample=known))
    )


def assigned(n, ratio=(8, 1, 1), seed=3):
    ranges = np.random.default_rng(seed).uniform(3, 40, n)
    split = SplitAssigner(ratio)
    return [split.assign(frame(k, r)) for k, r in enumerate(ranges)], ranges


def test_ratio_and_ranges():
    names, ranges = assigned(10_000)
    assert Counter(names) == {"train": 8000, "validation": 1000, "test": 1000}
    names = np.array(names)
    for low, high in ((3, 6), (6, 12), (12, 24), (24, 40)):
        here = names[(ranges >= low) & (ranges < high)]
        assert np.mean(here == "test") == pytest.approx(0.1, abs=0.01)
        assert np.mean(here == "validation") == pytest.approx(0.1, abs=0.01)


def test_few_frames_come_near_the_ratio():
    for n in (20, 40, 60):
        counts = Counter(assigned(n)[0])
        assert abs(counts["train"] - 0.8 * n) <= 3
        assert min(counts["validation"], counts["test"]) >= 0.05 * n


def test_a_larger_set_keeps_the_split():
    assert assigned(500)[0] == assigned(2000)[0][:500]


def test_pairs_and_sequences_stay_together():
    split = SplitAssigner((1, 1, 1))
    for k in range(300):
        pair = SimpleNamespace(pair=k // 2)
        split.assign(frame(k, 3 + k % 7, pair=pair, sequence=None))
    of = {n: name for name, numbers in split.numbers.items() for n in numbers}
    assert all(of[k] == of[k + 1] for k in range(0, 300, 2))
    assert [len(v) for v in split.numbers.values()] == [100, 100, 100]
    split = SplitAssigner((1, 1, 0))
    for k in range(100):
        split.assign(frame(k, 5.0, pair=None, sequence=SimpleNamespace(sequence=k // 25)))
    assert [len(v) for v in split.numbers.values()] == [50, 50, 0]


def test_what_is_settled_stays():
    split = SplitAssigner((1, 1, 0), {0: "test", 2: "train"})
    assert [split.assign(frame(k, 5.0)) for k in (0, 2)] == ["test", "train"]
    assert split.numbers == {"train": [2], "validation": [], "test": [0]}


def test_a_sequence_stays_in_the_split_of_its_settled_frame():
    split = SplitAssigner((1, 0, 0), {0: "test"})
    sequence = SimpleNamespace(sequence=7)
    assert [split.assign(frame(k, 5.0, pair=None, sequence=sequence)) for k in (0, 1)] == ["test", "test"]
    assert split.assign(frame(2, 5.0)) == "train"


def test_parse():
    assert parse_split("80:10:10") == (8, 1, 1)
    assert parse_split("1:0:1") == (1, 0, 1)
    assert lowest_terms([8000, 1000, 1000]) == (8, 1, 1)
    for text in ("8:1", "a:b:c", "0:0:0", "-1:1:1", "8:1:1:1", "1.5:1:1", "9999999:1:1", "9" * 5000 + ":1:1"):
        with pytest.raises(UserError, match="three whole numbers"):
            parse_split(text)


def test_the_card_names_every_field_of_the_records():
    named = {word.split("[]")[0].split(".")[0].strip() for key in RECORD_FIELDS for word in key.split(",")}
    assert set(Truth.__struct_encode_fields__) | set(ImportedTruth.__struct_fields__) <= named
    assert "record_fields" in DatasetCard.__struct_fields__
    assert any("pixel_px" in key for key in RECORD_FIELDS)
