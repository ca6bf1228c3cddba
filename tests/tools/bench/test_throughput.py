"""Processes that draw at once."""

import pytest

from flyaround.simulator.errors import UserError
from tools.bench.__main__ import app
from tools.bench.throughput import bench_throughput


@pytest.mark.gl
@pytest.mark.slow
def test_one_and_two_processes_are_timed():
    told: list[tuple[int, int]] = []
    machine, rates = bench_throughput(
        ("tango-space-10m+1024",), most=2, seconds=0.5, progress=lambda *turn: told.append(turn)
    )
    assert told == [(1, 2), (2, 2)]
    assert [(r.processes, r.width_px, r.height_px) for r in rates] == [(1, 1024, 1024), (2, 1024, 1024)]
    assert machine.gl_renderer
    assert all(r.frames_per_s > 0 and r.reference_ms > 0 for r in rates)


def test_an_unknown_scene_is_refused():
    with pytest.raises(UserError, match="unknown bench scene 'nowhere'"):
        app(["throughput", "2", "--scene", "nowhere"], standalone_mode=False)
