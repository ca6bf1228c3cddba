"""The spacecraft's rows of the rendering page: the quick ones always, Mitsuba's when asked for slow tests."""

import pytest

from flyaround.simulator.errors import UserError
from tools.validation.rendering import craft as rendering_craft
from tools.validation.rendering import path_traced as mitsuba_craft

pytestmark = pytest.mark.gl


def test_penumbra_is_as_wide_as_the_suns_disc(renderer):
    row = rendering_craft.penumbra_row(renderer)
    assert row.met, row


@pytest.mark.slow
def test_surfaces_penumbra_and_skylight_meet_their_integrals(renderer):
    for row in rendering_craft.quick_rows(renderer):
        assert row.met, row


@pytest.mark.slow
def test_edges_of_every_slope(renderer):
    for row in rendering_craft.edge_rows(renderer):
        # one row in thousands meets a sample that the rasteriser rounded to the edge's other side
        assert row.measured < 1.3 * row.goal, row


@pytest.mark.slow
@pytest.mark.timeout(1200)  # three path-traced pictures; a busy machine takes ten minutes
def test_tango_is_lit_as_mitsuba_lights_it(renderer):
    try:
        mitsuba_craft.load()
    except UserError as missing:
        pytest.skip(str(missing))
    rows = {row.what: row.measured for row in rendering_craft.mitsuba_rows(renderer, most_spp=256)}
    noise = rows.pop("Noise of the path-traced Tango, mean over it")
    assert noise < 0.02
    for what, measured in rows.items():
        # by default gaps between cells and low shadows are as seven samples and a coarse map find them
        p95 = 0.11 if "`high`" in what else 0.29
        assert measured < (0.015 if "median" in what else 0.02 if "FLIP" in what else p95), (what, measured)
    assert len(rows) in {6, 8}  # FLIP where its evaluator is installed
