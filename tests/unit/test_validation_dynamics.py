"""The accuracy page: every goal met, and what is said when the references are missing."""

from __future__ import annotations

from pathlib import Path

import pytest

from simulator.errors import UserError
from simulator.validation.dynamics import main, measure

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_every_goal_is_met(tmp_path: Path) -> None:
    out = tmp_path / "page.md"
    assert main(["--reference", str(ROOT / "tests" / "reference"), "-o", str(out)], say=lambda _: None) == 0
    assert "missed" not in out.read_text()


def test_missing_references_are_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no reference output"):
        measure(tmp_path)
