"""The rows of the rendering page about the limb, a star, the penumbra and moonlight."""

import pytest

from tools.validation.rendering import sky as rendering_sky

pytestmark = pytest.mark.gl


@pytest.mark.parametrize("roll_deg", [0.0, 17.0, 45.0])
def test_limb_lies_where_the_ellipsoid_ends(renderer, roll_deg):
    limb = rendering_sky.limb_error(renderer, roll_deg)
    assert len(limb.columns_px) > 30
    assert abs(limb.columns_px).max() < 0.05
    assert abs(limb.offset_px) < 0.025
    assert limb.share_rms < 0.03


def test_a_star_the_penumbra_and_moonlight_meet_their_goals(renderer):
    for row in rendering_sky.light_rows(renderer):
        assert row.met, row
