"""The proof of labels by rays: what a raster's rounding may show is no fault, what it may not is one."""

import pytest

from tools.validation.datasets.report import prove


@pytest.mark.slow
@pytest.mark.gl
def test_faces_thinner_than_a_step_of_the_raster_do_not_fall_behind_what_they_hide():
    """One pixel of 10,062 images: a Soyuz 33 m away, of whose blankets a fold is a tenth of a pixel wide."""
    found = next(iter(prove("urso-like", 68, 2813, 384, first=67)))
    assert found["faults"] == []
    assert (found["mask"], found["parts"], found["twice"]) == (0, 0, 0)
