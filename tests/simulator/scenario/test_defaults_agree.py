"""What is not said in a file and what is not said in a program are the same."""

from __future__ import annotations

from dataclasses import MISSING, fields

import msgspec
import pytest

from simulator.camera.detector.optics import Optics
from simulator.camera.sections import OpticsSection
from simulator.scenario import picture as scenario_picture
from simulator.scene.state import Environment

PAIRS = [(scenario_picture.EnvironmentSection, Environment)]


@pytest.mark.parametrize(("section", "inside"), PAIRS, ids=lambda c: c.__name__)
def test_defaults_of_a_file_are_those_of_the_simulation(section: type, inside: type) -> None:
    told = {f.name: f.default for f in msgspec.structs.fields(section) if f.default is not msgspec.NODEFAULT}
    used = {f.name: f.default for f in fields(inside) if f.default is not MISSING}
    both = told.keys() & used.keys()
    assert len(both) >= 3
    assert {k: told[k] for k in both} == {k: used[k] for k in both}


def test_everything_that_is_drawn_is_drawn_unless_said_otherwise() -> None:
    off = {f.name for f in fields(Environment) if f.default is False}
    assert off == {"undifferentiated"}
    assert Environment().atmosphere_thickness_km == 100.0


def test_diffraction_is_that_of_green_light_unless_said_otherwise() -> None:
    assert OpticsSection().wavelength_nm == 550.0
    assert pytest.approx(550e-9) == Optics().wavelength_m
