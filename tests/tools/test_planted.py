"""The list of planted bugs: each can be planted in the tree as it is, and has tests to run."""

from pathlib import Path

import pytest

from tools.mutants.judge import mirrored
from tools.planted.__main__ import PlantedBug, read_bugs

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("bug", read_bugs(), ids=lambda bug: bug.name)
def test_a_bug_can_be_planted_and_has_tests(bug):
    source = (ROOT / bug.file).read_text(encoding="utf-8")
    assert bug.planted(source) != source
    assert all((ROOT / test).exists() for test in (*bug.first, mirrored(bug.file)))


def test_fifty_bugs_have_names_of_their_own():
    bugs = read_bugs()
    assert len({bug.name for bug in bugs}) == len(bugs) >= 50
    drawn_or_told = (
        "shaders/",
        "simulator/labels/",
        "simulator/dataset/formats/",
        "simulator/world/messages/",
        "hil/link/",
    )
    assert sum(bug.file.startswith(drawn_or_told) for bug in bugs) >= 17


def test_text_that_stands_twice_is_refused():
    bug = PlantedBug(name="a", file="b.py", old="x", new="y", wrong="c", first=())
    with pytest.raises(ValueError, match="occurs 2 times"):
        bug.planted("x + x")
