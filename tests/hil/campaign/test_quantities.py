"""No board that does not do its work meets a requirement, unless the requirement is not about its work."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hil_loop import CAMERA, Loop, made_frame

from flyaround.hil.campaign.definitions import Requirement
from flyaround.hil.campaign.quantities import QUANTITIES, RunRecord
from flyaround.hil.campaign.verdicts import Verdict
from flyaround.hil.host.closed_loop_run import (
    fly_without_pictures,
    summary_without_pictures,
    write_steps,
)
from flyaround.hil.host.frame_record import FrameRecord
from flyaround.hil.host.ledger.summary import SUMMARY_JSON, summarise
from flyaround.hil.host.pose_link import PoseLink
from flyaround.hil.navigation.closed_loop import ClosedLoopConfig
from flyaround.simulator.runtime.files import write_document
from flyaround.simulator.scenario.faults import Drop
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

EXAMPLES = Path(__file__).parents[3] / "examples"
LIES = ("dead", "slow", "off_by_one", "lying", "silent")

LIMITS: dict[str, tuple[str, float | str]] = {
    "ended": ("==", "completed"),
    "unaccounted": ("==", 0.0),
    "sent": (">=", 1.0),
    "accepted_share": (">=", 0.1),
    "dropped_share": ("<=", 0.9),
    "dropped": ("<=", 7.0),
    "accepted_wrong": ("==", 0.0),
    "median_E_T_m": ("<=", 0.2),
    "median_E_R_deg": ("<=", 1.0),
    "largest_E_T_m": ("<=", 0.2),
    "largest_E_R_deg": ("<=", 1.0),
    "deadline_misses": ("<=", 7.0),
    "late": ("<=", 8.0),
    "late_poses": ("==", 0.0),
    "packets_corrupt": ("==", 0.0),
    "clock_drift_ppm": ("<=", 1e9),
}
"""What any board of some use meets; other quantities are times below a minute."""

ALLOWED = {
    "the run is the host's: frames that it offered, its ledger, its end": (
        LIES,
        {"sent", "unaccounted", "ended"},
    ),
    "the camera is the host's, whatever the board answers": (
        LIES,
        {
            "late",
            *(f"handover_error_ms_{q}" for q in ("p50", "p99", "p999", "max")),
            *(f"send_lag_ms_{q}" for q in ("p50", "p99")),
        },
    ),
    "damage is the line's, and so is the clock of a board that answers requests": (
        LIES,
        {"packets_corrupt", "clock_offset_bound_ms", "clock_drift_ppm"},
    ),
    "answered in time, as far as the host's clock tells, and accepted: right or wrong": (
        ("lying",),
        {
            "accepted_share",
            "dropped_share",
            "dropped",
            "deadline_misses",
            "late_poses",
            *(f"e2e_ms_{q}" for q in ("p50", "p95", "p99", "max")),
        },
    ),
}
"""Requirements that a board may meet without doing its work, by the reason: boards, and quantities."""

IN_A_LOOP = {
    "keep_out_violations": "a chaser without poses holds off",
    "min_range_m": "the same",
    "delta_v_m_s": "the same",
    "duration_s": "an approach is given up in time",
    "hold_s": "it is given up, not held",
    "ended": "the flight came to its end",
}


def spots(n):
    """Pictures of a spot that the example board finds at 10 m, where it truly is."""
    for k in range(n):
        image = np.zeros((48, 64), np.uint8)
        image[20:23, 10 + 2 * k : 13 + 2 * k] = 200
        x, y = (11 + 2 * k - CAMERA["cx_px"]) / CAMERA["fx_px"], (21 - CAMERA["cy_px"]) / CAMERA["fy_px"]
        yield made_frame(k, image, every_s=0.1, t_m=(10 * x, 10 * y, 10.0))


def flown_with(folder, *script, **options):
    """The record of eight pictures in real time to an example board."""
    boards = []

    def start(url):
        address = url.partition("://")[2].rsplit(":", 1)
        boards.append(subprocess.Popen([sys.executable, str(EXAMPLES / script[0]), *script[1:], *address]))

    try:
        Loop(start).run(spots(8), mode="realtime", max_misses=0, log_dir=folder, **options)
    finally:
        for process in boards:
            process.kill()
            process.wait()
    return RunRecord.read(folder)


def verdict(name, record):
    comparison, limit = LIMITS.get(name, ("<=", 60_000.0))
    requirement = Requirement(name="one", quantity=name, comparison=comparison, limit=limit)
    return Verdict.from_value(requirement, QUANTITIES[name].value_of(record))


def names(*, closed_loop):
    return [name for name, q in QUANTITIES.items() if closed_loop or "closed_loop" not in q.needs]


def test_a_good_board_meets_what_is_required(tmp_path):
    record = flown_with(tmp_path, "board_python.py", deadline_s=60.0)
    missed = [v.sentence for name in names(closed_loop=False) if not (v := verdict(name, record)).passed]
    # drift is known after some seconds alone
    assert [sentence for sentence in missed if "clock_drift_ppm" not in sentence] == []


@pytest.mark.parametrize("lie", LIES)
def test_no_requirement_passes_on_a_board_that_lies_but_those_that_say_why(lie, tmp_path):
    times = {"deadline_s": 60.0} if lie == "lying" else {"deadline_s": 0.5, "timeout_s": 0.5}
    record = flown_with(tmp_path, "lying_board.py", lie, **times)
    assert record.summary.ended == "completed"
    assert record.summary.sent == 8
    passed = {name for name in names(closed_loop=False) if verdict(name, record).passed}
    allowed = {name for boards, quantities in ALLOWED.values() if lie in boards for name in quantities}
    assert passed <= allowed
    if lie == "lying":
        assert record.summary.time_faults == record.summary.accepted > 0
        assert verdict("accepted_wrong", record).value == record.summary.accepted
    else:
        assert record.summary.deadline_misses == 8


def test_in_a_closed_loop_a_dead_board_arrives_nowhere(tmp_path):
    plan = plan_flight(load_scenario("tango-vbar-closed-loop"), n=1, seed=1)
    link = PoseLink(faults=(Drop(chance=1.0),))
    result = fly_without_pictures(plan, ClosedLoopConfig(seed=1), "noisy", link)
    write_steps(tmp_path, result.steps)
    write_document(tmp_path / SUMMARY_JSON, summary_without_pictures(result, "noisy", 1))
    record = RunRecord.read(tmp_path)
    loop = {name for name, q in QUANTITIES.items() if "closed_loop" in q.needs or not q.needs}
    limits = {"outcome": ("==", "arrived"), "final_error_m": ("<=", 1.0), "final_error_deg": ("<=", 5.0)}
    limits |= {"min_range_m": (">=", 1.0), "keep_out_violations": ("==", 0.0), "hold_s": ("<=", 5.0)}
    passed = set()
    for name in loop:
        comparison, limit = limits.get(name, LIMITS.get(name, ("<=", 1e4)))
        requirement = Requirement(name="one", quantity=name, comparison=comparison, limit=limit)
        if Verdict.from_value(requirement, QUANTITIES[name].value_of(record)).passed:
            passed.add(name)
    assert passed <= IN_A_LOOP.keys()


RUN = {
    "started_utc": "2026-01-01T00:00:00Z",
    "ended": "completed",
    "mode": "realtime",
    "truth": "off",
    "url": "",
    "timeout_s": 1.0,
    "deadline_ms": 100.0,
}


def rows(*e2e_ms):
    """Frames that were sent, by their latency; None: no answer."""
    return tuple(
        FrameRecord(
            frame_id=k,
            epoch_utc="",
            t_s=0.1 * k,
            exposure_s=0.01,
            outcome="dropped:timeout" if ms is None else "accepted",
            send_ms=1.0,
            e2e_ms=ms,
        )
        for k, ms in enumerate(e2e_ms)
    )


EARLY_AND_LATE_MS = (-40.0, -8.0, 0.5, 1.0, 2.0)


def of(name, given):
    return QUANTITIES[name].value_of(RunRecord(summarise(given, **RUN), given, {}))


def test_pictures_that_come_too_early_are_as_wrong_as_late_ones():
    given = tuple(
        replace(row, handover_error_ms=error)
        for row, error in zip(rows(*[5.0] * 5), EARLY_AND_LATE_MS, strict=True)
    )
    sizes = sorted(abs(x) for x in EARLY_AND_LATE_MS)
    assert of("handover_error_ms_p50", given) == sizes[2]
    assert of("handover_error_ms_max", given) == sizes[-1] == 40.0


@pytest.mark.parametrize(
    ("e2e_ms", "median", "largest", "misses"),
    [
        ((10.0, 20.0, 30.0), 20.0, 30.0, 0),
        ((10.0, 20.0, 300.0), 20.0, 300.0, 1),
        # dead after its first answers: half of all have no time, so that no limit is met
        ((10.0, 20.0, None), 20.0, None, 1),
        ((10.0, None, None), None, None, 2),
        ((None, None, None), None, None, 3),
    ],
)
def test_latency_is_over_all_that_the_board_was_sent(e2e_ms, median, largest, misses):
    given = rows(*e2e_ms)
    assert of("e2e_ms_p50", given) == median
    assert of("e2e_ms_max", given) == largest
    assert of("deadline_misses", given) == misses
    # one that waited at the host and made room for a newer one was not sent, and is a miss of the deadline alone
    waited = replace(rows(None)[0], frame_id=9, outcome="dropped:superseded", send_ms=None)
    assert of("e2e_ms_max", (*given, waited)) == largest
    assert of("deadline_misses", (*given, waited)) == misses + 1


def test_nothing_sent_has_no_count():
    for name in ("dropped", "dropped_share", "accepted_share", "accepted_wrong", "deadline_misses"):
        assert of(name, ()) is None
    assert of("late_poses", rows(None, None)) is None
    assert of("accepted_wrong", rows(10.0)) is None  # its truth is not known


@pytest.mark.parametrize("value", [None, float("nan"), float("inf"), float("-inf")])
@pytest.mark.parametrize("comparison", ["<=", "<", ">=", ">", "==", "!="])
def test_a_quantity_without_a_value_meets_nothing_and_says_what_it_is(comparison, value):
    requirement = Requirement(name="on time", quantity="e2e_ms_p99", comparison=comparison, limit=100.0)
    missed = Verdict.from_value(requirement, value)
    assert (missed.passed, missed.value, missed.margin) == (False, None, None)
    assert missed.sentence.startswith(
        "on time: e2e_ms_p99 has no value (time from sending a frame to receiving its pose, "
    )
