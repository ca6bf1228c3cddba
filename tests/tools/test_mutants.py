"""Mutants and their judge: samples are repeatable, and the judge tells seen bugs from unseen ones."""

import ast
import subprocess
from pathlib import Path

import pytest

from tools.mutants import judge
from tools.mutants.__main__ import case_of, draw, files

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_a_sample_is_repeatable_and_can_be_planted():
    names = files(ROOT, ["simulator/world/frames", "hil/link/framing"])
    drawn = draw(ROOT, names, 20, 5)
    assert [item.mutations for item in drawn] == [item.mutations for item in draw(ROOT, names, 20, 5)]
    cases = [case_of(ROOT, item) for item in drawn]
    assert len({(case.file, case.after) for case in cases}) > 15
    for case in cases:
        assert case.after != case.before
        ast.parse(case.after)
        assert all((ROOT / test).exists() for test in case.tests)
    assert any(
        "tests/hil/link/test_framing.py" in case.tests or "tests/hil/link" in case.tests for case in cases
    )


_SMALL = """
def seen(x):
    return x + 1


def unseen(x):
    return x + 2


def counted(x):
    while x > 0:
        x -= 1
    return x
"""
_SMALL_TESTS = """
import small


def test_seen():
    assert small.seen(1) == 2


def test_counted():
    assert small.counted(3) == 0
"""


@pytest.fixture
def small(tmp_path):
    """A package of three functions, of which the tests look at one, hang on one and never call one."""
    root, cache = tmp_path / "root", tmp_path / "cache"
    cache.mkdir()
    root.mkdir()
    subprocess.run(["git", "init", "-q"], cwd=root, check=True)
    (root / "small.py").write_text(_SMALL)
    (root / "test_small.py").write_text(_SMALL_TESTS)
    copy = judge.Copy(tmp_path / "copy", cache)
    copy.make(root)
    return copy


@pytest.mark.slow
def test_a_judge_tells_what_is_seen_from_what_is_not(small, monkeypatch):
    monkeypatch.setattr(judge, "TEST_S", 10.0)
    changes = {"seen": ("x + 1", "x - 1"), "unseen": ("x + 2", "x - 2"), "counted": ("-= 1", "+= 1")}
    cases = [
        judge.Case(name, "small.py", _SMALL, _SMALL.replace(*change), ("test_small.py",))
        for name, change in changes.items()
    ]
    heard: dict[str, str] = {}
    judge.judge(cases, [small], lambda case, verdict: heard.update({case.name: verdict.word}))
    assert heard == {"seen": "killed", "unseen": "survived", "counted": "timeout"}
    assert (small.tree / "small.py").read_text() == _SMALL
