"""One small data set in every format, for all tests of formats."""

import dataclasses
from importlib.util import find_spec

import pytest
from small_flight import small_flight

from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.formats.registry import writable
from flyaround.simulator.labels.request import LAYERS

N = 6


@pytest.fixture(scope="session")
def small_plan():
    """Makes plans of Tango on 384 pixels, whose fx, fy and middle cannot be taken for each other."""

    def make(n=N, *, bands=None, **sensor):
        plan = small_flight(384, n=n, bands=bands)
        camera = plan.camera
        # no lens: one of the formats holds none
        camera = dataclasses.replace(
            camera,
            fy_px=0.88 * camera.fy_px,
            cx_px=camera.cx_px + 9,
            cy_px=camera.cy_px - 6,
        )
        return dataclasses.replace(plan, camera=camera)

    return make


@pytest.fixture(scope="session")
def everything(small_plan, tmp_path_factory):
    """Six frames with all layers, split 4:1:1, in all formats whose libraries are here."""
    folder = tmp_path_factory.mktemp("formats") / "set"
    names = [name for name in writable() if name != "parquet" or find_spec("pyarrow")]
    told = []
    capture(small_plan(), folder, formats=tuple(names), labels=LAYERS, split=(4, 1, 1), tell=told.append)
    assert len(told) == len(names) - 1
    return folder
