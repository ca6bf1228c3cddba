"""Where an evaluation draws its lines: a region that serves, an error that labels cannot tell from none."""

from __future__ import annotations

import numpy as np
import pytest

from flyaround.hil.board.svd.region_of_interest import Region
from flyaround.hil.evaluate.failure_stage import HELD, TOO_LARGE, _serves
from flyaround.hil.evaluate.metrics import summarise
from flyaround.hil.evaluate.pose_errors import _nees, frame_record

BOX = (100.0, 50.0, 200.0, 90.0)


def region(x0: float, y0: float, x1: float, y1: float) -> Region:
    return Region(x0, y0, x1, y1, "test")


@pytest.mark.parametrize(
    ("box", "serves"),
    [
        (BOX, True),
        ((100.0, 50.0, 151.0, 90.0), True),  # a little more than half of it
        ((100.0, 50.0, 149.0, 90.0), False),
        ((151.0, 50.0, 200.0, 90.0), False),
        ((100.0, 50.0, 200.0, 71.0), True),
        ((100.0, 72.0, 200.0, 90.0), False),
        ((60.0, 30.0, 260.0, 180.0), True),  # all of it, in 7.5 times its area
        ((60.0, 30.0, 260.0, 200.0), False),  # 8.5 times
        ((300.0, 50.0, 400.0, 90.0), False),  # beside it
        ((0.0, 50.0, 90.0, 90.0), False),
        ((100.0, 100.0, 200.0, 140.0), False),  # below it
        (
            (0.0, 100.0, 90.0, 140.0),
            False,
        ),  # off both ways, where two negative shares would make a positive one
    ],
)
def test_a_region_serves_that_holds_half_and_is_not_far_too_large(
    box: tuple[float, float, float, float], *, serves: bool
) -> None:
    assert (HELD, TOO_LARGE) == (0.5, 8.0)
    assert _serves(region(*box), BOX) is serves


@pytest.mark.parametrize(
    ("turn_deg", "share", "wanted"),
    [
        (0.16, 0.0020, 0.0),
        (0.18, 0.0020, np.radians(0.18)),
        (0.16, 0.0023, 0.0023),
        (0.18, 0.0023, np.radians(0.18) + 0.0023),
    ],
)
def test_speed_plus_counts_no_error_below_what_its_labels_are_good_for(
    turn_deg: float, share: float, wanted: float
) -> None:
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


def test_an_error_is_weighed_by_its_covariance_unless_that_is_below_rounding() -> None:
    error = np.array([1.0, 2.0, 0.0, -1.0, 0.5, 3.0])
    variances = np.array([1.0, 4.0, 2.0, 0.5, 0.25, 9.0])
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(6, 6)))[0]
    covariance = turn @ np.diag(variances) @ turn.T
    wanted = error @ np.linalg.solve(covariance, error)
    assert _nees(error, covariance) == pytest.approx(wanted, rel=1e-9)
    assert _nees(error, np.diag(variances)) == pytest.approx(1 + 1 + 0 + 2 + 1 + 1)
    # the smallest is lost beside the largest, not beside the next
    assert _nees(error, np.diag([1e-12, 1e-12, 1.0, 1.0, 1.0, 1e6])) is None
    assert _nees(error, np.diag([1e-6, 1.0, 1.0, 1.0, 1.0, 1e6])) is not None
    assert _nees(error, np.diag([-1.0, 1.0, 1.0, 1.0, 1.0, 1.0])) is None
    assert _nees(error, np.eye(5)) is None
    assert _nees(error, None) is None
