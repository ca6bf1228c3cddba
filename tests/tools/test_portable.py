"""The factors of `make test-portable` are shown to act: a variable that a library ignores proves nothing."""

from dataclasses import replace
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def portable(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import portable

    return portable


def test_a_factor_that_does_not_act_is_no_pass(portable):
    factor = portable.factors()[0]
    told = portable.run(replace(factor, shown="raise SystemExit('runs as ever')", tests=()))
    assert told == "has no effect: runs as ever"


def test_every_factor_finds_its_tests(portable):
    names = [factor.name for factor in portable.factors()]
    assert names[-1] == "worst"
    assert len(set(names)) == len(names)
    for factor in portable.factors():
        assert portable._files(factor.tests), factor.name
