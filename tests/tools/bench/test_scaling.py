"""How the cost of a frame grows with pixels and triangles."""

import pytest

from tools.bench.scaling import bench_scaling


@pytest.mark.slow
@pytest.mark.gl
def test_cost_is_linear_in_pixels_and_less_than_linear_in_triangles():
    found = bench_scaling(triangles=(20_000, 160_000, 1_000_000))
    assert max(found.pixel_powers) < 1.15
    assert max(found.triangle_powers) < 1.0
