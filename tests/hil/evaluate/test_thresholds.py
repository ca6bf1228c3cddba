"""Where an evaluation draws its lines: a region that serves, an error that labels cannot tell from none."""

import numpy as np
import pytest

from flyaround.hil.board.svd.region_of_interest import Region
from flyaround.hil.evaluate.metrics import summarise
from flyaround.hil.evaluate.pose_errors import frame_record


def region(x0, y0, x1, y1):
    return Region(x0, y0, x1, y1, "test")


@pytest.mark.parametrize(
    ("turn_deg", "share", "wanted"),
    [
        (0.16, 0.0020, 0.0),
        (0.18, 0.0020, np.radians(0.18)),
        (0.16, 0.0023, 0.0023),
        (0.18, 0.0023, np.radians(0.18) + 0.0023),
    ],
)
def test_speed_plus_counts_no_error_below_what_its_labels_are_good_for(turn_deg, share, wanted):
    """Park et al. (2023): 0.169 deg and 2.173 mm per metre."""
    half = np.radians(turn_deg) / 2
    turned = np.array([np.cos(half), np.sin(half), 0.0, 0.0])
    record = frame_record(
        (1.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 10.0),
        turned,
        np.array([0.0, 0.0, 10.0 * (1 + share)]),
        accepted=True,
        feasible=True,
        frame_class="feasible",
    )
    assert summarise([record]).speed_plus_score == pytest.approx(wanted, rel=1e-6, abs=1e-9)
