"""Tango under one lamp, for tests of single stages."""

import pytest
from lamp_lit import CAMERA, SUN, T_M, Q, lamp_lit

from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.simulator.targets.library import load_target


@pytest.fixture(scope="module")
def craft() -> PreparedTarget:
    return PreparedTarget.prepare(board_model(load_target("tango")), CAMERA)


@pytest.fixture(scope="module")
def frame(craft: PreparedTarget) -> Observation:
    return lamp_lit(craft, CAMERA, Q, T_M, SUN)
