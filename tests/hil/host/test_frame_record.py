"""A frame's record: from clock readings on the way to the columns of the ledger."""

import pytest

from flyaround.hil.host.frame_record import FrameRecord, FrameTimes, complete, utc_text
from flyaround.hil.link.packets.messages import PoseMessage

S = 1_000_000_000
OFFSET_NS = 500 * S
UTC_NS = 1_795_000_000 * S
TRUTH = ((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 10.0))


def sent(**times):
    record = FrameRecord(frame_id=4, epoch_utc="2026-01-01T00:00:00Z", t_s=1.0, exposure_s=0.01)
    return record.with_times(
        due_ns=10 * S, latency_s=0.1, drawn_ns=9 * S, handed_over_ns=10 * S + 2000, **times
    )


def answered(receive_s=10.1, end_s=10.3, **clock):
    at = [OFFSET_NS + round(s * S) for s in (receive_s, 10.2, end_s)]
    pose = PoseMessage(4, True, "", (1.0, 0.0, 0.0, 0.0), (0.0, 0.03, 10.04), 0.5, (("roi", 1.5),), *at)
    known = {"clock_offset_ns": OFFSET_NS, "clock_bound_ns": 1000} | clock
    start = sent(send_start_ns=round(10.05 * S), send_end_ns=round(10.08 * S))
    return start.with_outcome("accepted", "", received_ns=round(10.4 * S), answer=pose, **known)


def test_an_answer_fills_the_columns():
    row = complete(answered(), TRUTH, UTC_NS, deadline_ms=400.0)
    assert row.e2e_ms == pytest.approx(350.0)
    assert row.uplink_ms + row.board_total_ms + row.downlink_ms == pytest.approx(row.e2e_ms)
    assert (row.send_lag_ms, row.send_ms) == pytest.approx((50.0, 30.0))
    # mid-exposure lies 105 ms before the picture was due
    assert row.staleness_ms == pytest.approx(305.0)
    assert row.handover_error_ms == pytest.approx(0.002)
    assert (row.late, row.deadline_met, row.time_fault, row.wrong) == (False, True, "", False)
    assert (row.E_T_m, row.E_R_deg) == pytest.approx((0.05, 0.0), abs=1e-9)
    assert row.exposure_end_utc == utc_text(UTC_NS + 10 * S - S // 10)
    assert row.begun_utc == utc_text(UTC_NS + round(10.2 * S))
    assert row.stages_ms == {"roi": 1.5}
    assert row.times == FrameTimes()


def test_a_frame_that_was_dropped_has_the_times_that_it_came_to():
    row = complete(
        sent().with_outcome("dropped:superseded", "a newer one came"), TRUTH, UTC_NS, deadline_ms=400.0
    )
    assert (row.outcome, row.reason) == ("dropped:superseded", "a newer one came")
    assert row.handed_over_utc
    assert (row.sent_utc, row.received_utc, row.e2e_ms, row.board_total_ms) == ("", "", None, None)
    assert row.deadline_met is False
    assert (row.truth_t_m, row.t_m, row.E_T_m) == (TRUTH[1], None, None)


@pytest.mark.parametrize(
    ("record", "words"),
    [
        (answered(receive_s=10.25), "not in this order"),
        (answered(receive_s=10.0), "before it was sent"),
        (answered(end_s=10.5), "after the answer was received"),
    ],
)
def test_board_times_that_cannot_be_are_left_out(record, words):
    row = complete(record, TRUTH)
    assert words in row.time_fault
    assert (row.board_wait_ms, row.uplink_ms, row.begun_utc, row.staleness_ms) == (None, None, "", None)
    assert row.e2e_ms is not None


def test_without_an_offset_only_durations_of_the_board_are_known():
    row = complete(answered(clock_offset_ns=None, clock_bound_ns=None), TRUTH)
    assert row.board_total_ms == pytest.approx(200.0)
    assert (row.uplink_ms, row.downlink_ms, row.answered_utc) == (None, None, "")
