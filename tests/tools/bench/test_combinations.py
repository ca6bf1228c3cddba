"""The goals of bench combinations, and the combinations it times."""

import pytest

from flyaround.simulator.errors import UserError
from tools.bench.combinations import bench_combinations, goals_of


def test_a_scenario_that_is_none_is_refused():
    with pytest.raises(UserError, match="unknown scenario 'tango-earth' in --scene"):
        bench_combinations(("tango-earth",))


@pytest.mark.slow
def test_every_camera_and_variant_of_the_base_scenario_is_timed():
    _, costs = bench_combinations(("tango-earth-10m",), n_frames=2)
    assert len(costs) == 5 * 2 + 4 + 3 + 1
    assert all(c.frame_ms > 0 and c.capture_ms > 0 and c.reference_ms > 0 for c in costs)
    assert len(goals_of(costs)) == 8
