"""The accuracy page: every goal met, and what is said when the references are missing."""

from pathlib import Path

import pytest

from flyaround.simulator.errors import UserError
from tools.validation.dynamics.independent import against_astropy, against_sgp4
from tools.validation.dynamics.physics import axisymmetric_errors
from tools.validation.dynamics.report import main, measure

ROOT = Path(__file__).parents[3]


@pytest.mark.slow
def test_every_goal_is_met(tmp_path):
    out = tmp_path / "page.md"
    assert main(["--reference", str(ROOT / "tests" / "reference"), "-o", str(out)], say=lambda _: None) == 0
    assert "missed" not in out.read_text()


def test_missing_references_are_named(tmp_path):
    with pytest.raises(UserError, match="no reference output"):
        measure(tmp_path)


def test_earth_rotation_is_astropys_and_tles_are_vallados():
    rows = [against_astropy(ROOT / "tests" / "reference"), *against_sgp4()]
    assert all(row.met for row in rows), rows
    # of 546 published ones 18 are below the surface or beyond the body's reach, and refused
    assert "528 states" in rows[1].against


def test_axisymmetric_body_turns_as_euler_has_it():
    rate, attitude = axisymmetric_errors(600.0)
    assert rate < 1e-12
    assert attitude < 1e-10
