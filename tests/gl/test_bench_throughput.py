"""Processes that draw at once."""

import pytest

from flyaround.__main__ import run
from simulator.bench import throughput
from simulator.bench.throughput import bench_throughput, counts_up_to


@pytest.mark.parametrize(("most", "counts"), [(1, [1]), (2, [1, 2]), (6, [1, 2, 4, 6]), (8, [1, 2, 4, 8])])
def test_numbers_of_processes(most, counts):
    assert counts_up_to(most) == counts


@pytest.mark.gl
def test_two_processes_draw_as_one_does():
    told = []
    machine, rates = bench_throughput(
        ("tango-space-10m+1024",), most=2, seconds=1.0, progress=lambda k, n: told.append((k, n))
    )
    assert told == [(1, 2), (2, 2)]
    assert [(r.processes, r.width_px, r.height_px) for r in rates] == [(1, 1024, 1024), (2, 1024, 1024)]
    # seconds of work a process, as two share the processors that one had: within a factor of each other
    assert 0.3 < rates[1].frames_per_s / rates[0].frames_per_s < 4
    assert machine.gl_renderer


@pytest.mark.gl
def test_a_process_that_fails_is_said(monkeypatch):
    with pytest.raises(RuntimeError, match="ended or did not begin"):
        throughput._rate("tango-space-10m+1024", 1, 9999, 1.0)


def test_an_unknown_scene_is_refused(capsys):
    assert run(["bench", "--processes", "2", "--scene", "nowhere"]) == 2
    assert "unknown bench scene 'nowhere'" in " ".join(capsys.readouterr().err.split())
