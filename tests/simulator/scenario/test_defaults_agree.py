"""What is not said in a file is what a program that says nothing gets."""

import msgspec
import pytest

from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.sections import OpticsSection
from flyaround.simulator.scene.environments import Environment


def test_everything_that_is_drawn_is_drawn_unless_said_otherwise():
    off = {f.name for f in msgspec.structs.fields(Environment) if f.default is False}
    assert off == {"undifferentiated"}
    assert Environment().atmosphere_thickness_km == 100.0


def test_diffraction_is_that_of_green_light_unless_said_otherwise():
    assert OpticsSection().wavelength_nm == 550.0
    assert pytest.approx(550e-9) == Optics().wavelength_m
