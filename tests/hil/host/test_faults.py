"""Faults on purpose: they strike when and what they say, are told in the ledger, and come again with the same seed."""

import threading
import time
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from hil_loop import Instant, Loop, adds_up, board, made_frame
from tutorial import blocks

from flyaround.hil.corner_code import CodePlace, read_code
from flyaround.hil.host.faults.camera_faults import StuckExposureTrack, with_camera_faults
from flyaround.hil.host.faults.line_faults import FaultJournal, _Pump
from flyaround.hil.host.flight_run import with_time_code
from flyaround.hil.host.pose_link import PoseLink
from flyaround.hil.link.packets.messages import PoseMessage
from flyaround.hil.link.packets.packet import Packet, PacketType
from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.faults import (
    Bandwidth,
    Blinding,
    CameraFault,
    ColumnLoss,
    Corrupt,
    DeadPixels,
    Delay,
    Disconnect,
    Drop,
    Duplicate,
    Faults,
    FrozenPicture,
    GainStep,
    HalfFrame,
    Jitter,
    LineFault,
    Reorder,
    RepeatedNumber,
    RowLoss,
    StuckExposure,
    StuckPixels,
    read_faults,
)
from flyaround.simulator.world.time.instant import nanoseconds_utc

N = 8
TRIES = 5
EVERY_S = 0.1


def flight(n=N, every_s=EVERY_S, size=(48, 64)):
    rng = np.random.default_rng(1)
    for k in range(n):
        image = rng.integers(1, 120, size).astype(np.uint8)
        yield made_frame(k, image, every_s=every_s, t_m=(0.0, 0.0, 1.0))


def struck(*camera, seed=4):
    return list(with_camera_faults(flight(), Faults(seed=seed, camera=camera)))


@pytest.mark.parametrize(
    "fault",
    [
        StuckPixels(share=0.05, start_s=0.3),
        DeadPixels(share=0.05, start_s=0.3),
        RowLoss(rows=3, start_s=0.3),
        ColumnLoss(columns=2, start_s=0.3),
        HalfFrame(start_s=0.3),
        FrozenPicture(start_s=0.3),
        Blinding(start_s=0.3),
        GainStep(factor=1.5, start_s=0.3),
    ],
)
def test_camera_faults_begin_when_they_say_and_repeat(fault):
    once, again, clean = struck(fault), struck(fault), list(flight())
    for k in range(N):
        assert np.array_equal(once[k].image, again[k].image)
        assert once[k].image.dtype == np.uint8
        same = np.array_equal(once[k].image, clean[k].image)
        if k * EVERY_S < 0.3 - 1e-9:
            assert same
            assert once[k].faults == ()
        else:
            assert not same
            assert once[k].faults == (fault.name,)
        # the truth is of the flight, whatever the camera does
        assert once[k].truth == clean[k].truth


def test_what_each_camera_fault_does():
    clean = list(flight())
    rows = struck(RowLoss(rows=3))
    assert all(np.count_nonzero((f.image == 0).all(axis=1)) == 3 for f in rows)
    lost = [set(np.nonzero((f.image == 0).all(axis=1))[0]) for f in rows]
    assert len({tuple(sorted(r)) for r in lost}) > 1
    columns = struck(ColumnLoss(columns=2))
    dark = {tuple(np.nonzero((f.image == 0).all(axis=0))[0]) for f in columns}
    assert len(dark) == 1
    assert len(dark.pop()) == 2
    half = struck(HalfFrame(at=0.25))
    assert all((f.image[12:] == 0).all() for f in half)
    assert all(np.array_equal(f.image[:12], c.image[:12]) for f, c in zip(half, clean, strict=True))
    frozen = struck(FrozenPicture(start_s=0.3, end_s=0.6))
    assert all(np.array_equal(frozen[k].image, clean[2].image) for k in (3, 4, 5))
    assert np.array_equal(frozen[6].image, clean[6].image)
    stuck = struck(StuckPixels(share=0.1))
    where = [f.image != c.image for f, c in zip(stuck, clean, strict=True)]
    always = np.logical_or.reduce(where)
    assert 0.07 < always.mean() < 0.13
    assert all(np.array_equal(f.image[always], stuck[0].image[always]) for f in stuck)
    blinded = struck(Blinding(x=0.5, y=0.5, radius=0.1))[0].image
    assert blinded[24, 32] == 255
    assert abs(int(blinded[0, 0]) - int(clean[0].image[0, 0])) <= 1
    gain = struck(GainStep(factor=2.0))
    assert np.array_equal(gain[0].image, np.minimum(255, 2 * clean[0].image.astype(int)))


def test_exposure_sticks():
    class Track:
        def exposure_s(self, t_s):
            return 0.01 + t_s

    held = StuckExposureTrack(Track(), (StuckExposure(start_s=1.0, end_s=3.0),))
    assert [held.exposure_s(t) for t in (0.5, 1.0, 2.9, 3.0)] == pytest.approx([0.51, 1.01, 1.01, 3.01])


def test_time_code_says_number_and_time_and_a_counter_may_repeat():
    faults = Faults(camera=(RepeatedNumber(start_s=0.25, end_s=0.45),))
    frames = list(with_time_code(flight(size=(80, 120)), faults=faults))
    codes = [read_code(f.image, CodePlace()) for f in frames]
    assert [c.frame_id for c in codes] == [0, 1, 2, 2, 2, 5, 6, 7]
    assert all(c.time_ns == nanoseconds_utc(f.scene.epoch_utc) for c, f in zip(codes, frames, strict=True))
    assert [f.faults for f in frames][2:5] == [(), ("repeated_number",), ("repeated_number",)]
    assert frames[0].time_code_px == (0, 0, 108, 60)
    with pytest.raises(UserError, match="a time code takes 108 x 60 px"):
        next(with_time_code(flight()))


def run(*line, seed=7, n=N, **options):
    rows = []
    options = {"truth": "off", **options}
    summary = Loop(board(Instant)).run(
        flight(n), faults=Faults(seed=seed, line=line), on_row=rows.append, **options
    )
    assert adds_up(summary)
    return summary, sorted(rows, key=lambda row: row.frame_id)


def test_injected_delay_shows():
    _, clean = run(n=20)
    _, late = run(Delay(delay_ms=50.0), n=20)
    # the least of each: a busy machine adds to frames and takes from none; twice the delay would be 100
    extra = min(row.e2e_ms for row in late) - min(row.e2e_ms for row in clean)
    assert 48.0 < extra < 90.0, extra
    assert all(row.faults == ("delay",) for row in late)


@pytest.mark.parametrize("fault", [Drop(chance=0.4, direction="to_host"), Corrupt(chance=0.4)])
def test_lost_and_damaged_frames_are_told_and_come_again(fault):
    runs: list[list[tuple[str, tuple[str, ...]]]] = []
    # a busy machine may hold up a frame of a run, which is lost then, too
    while sum(one == runs[-1] for one in runs) < 2:
        assert len(runs) < TRIES, runs
        summary, rows = run(fault, max_misses=0, timeout_s=0.6)
        runs.append([(row.outcome, row.faults) for row in rows])
    outcomes = [row.outcome for row in rows]
    assert any(o.startswith("dropped:") for o in outcomes)
    assert "accepted" in outcomes
    for row in rows:
        assert (row.outcome == "accepted") or row.faults == (fault.name,)
    assert summary.sent == N


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_frames_that_never_reach_the_board_do_not_use_up_its_credit(mode):
    """Header and pixels lost, or one of them: the board is asked what it has, and the run goes on."""
    n = 12 if mode == "lockstep" else 36  # one that is held up for a second or two goes on, too
    summary, rows = run(Drop(chance=0.4, direction="to_board"), n=n, mode=mode, seed=3)
    whole = [row for row in rows if "drop" not in row.faults]
    assert len(whole) < n
    assert summary.dropped.keys() <= {"lost", "corrupt", "superseded"}
    # the last of the flight may be any; all that were sent whole were answered
    sent = [row for row in whole if row.sent_utc]
    assert {row.outcome for row in sent} == {"accepted"}
    # half the flight on, they are answered still: nobody starves
    assert any(row.outcome == "accepted" for row in rows[6:])
    assert "lost" in summary.dropped
    assert summary.ended == "completed"


def test_a_board_that_does_not_tell_what_came_is_not_taken_for_one_that_lost_it():
    """A quiet board at work for longer than the host takes to ask."""

    class Thinks(Instant):
        def estimate(self, image):
            time.sleep(0.7)
            return super().estimate(image)

    summary, rows = run(n=2)
    told = Loop(board(Thinks)).run(flight(2), on_row=rows.append)
    assert (summary.accepted, told.accepted) == (2, 2)


def test_duplicates_change_nothing_in_the_books():
    summary, rows = run(Duplicate(chance=1.0, direction="to_host"))
    assert summary.accepted == N
    assert all(row.faults == ("duplicate",) for row in rows)
    assert summary.link.mistakes["a second answer to a frame"] >= N - 1


def test_bandwidth():
    _, rows = run(Bandwidth(bytes_per_s=30_000))
    # 3072 bytes of pixels and some hundred beside them
    assert all(row.e2e_ms > 1e3 * 3072 / 30_000 for row in rows)


def test_reordered_packets_of_a_stream_are_damage():
    _, rows = run(Reorder(chance=1.0, direction="to_board"), max_misses=0, timeout_s=0.5, n=3)
    assert all(row.faults == ("reorder",) for row in rows)


def test_disconnection_is_survived():
    rows = []

    def twice(url):
        board(Instant)(url)
        board(Instant)(url)

    faults = Faults(line=(Disconnect(start_s=0.35),))
    summary = Loop(twice).run(flight(), faults=faults, on_row=rows.append, truth="off")
    rows.sort(key=lambda row: row.frame_id)
    assert adds_up(summary)
    assert summary.link.sessions == 2
    assert [row.outcome for row in rows].count("dropped:disconnected") == 1
    assert "disconnect" in rows[4].faults
    assert summary.accepted == N - 1


def test_the_page_s_file_is_read_and_names_every_kind(tmp_path):
    page = (Path(__file__).parents[3] / "docs" / "formats" / "faults.md").read_text()
    (_, title, text), *_ = blocks(Path(__file__).parents[3] / "docs" / "formats" / "faults.md")
    (tmp_path / title).write_text(text)
    faults = read_faults(tmp_path / title)
    assert (len(faults.camera), len(faults.line)) == (2, 2)
    for kind in (*get_args(CameraFault), *get_args(LineFault)):
        assert f"| `{kind.__struct_config__.tag}` |" in page


def test_faults_file(tmp_path):
    path = tmp_path / "faults.toml"
    path.write_text(
        'schema = "flyaround.faults"\nversion = 1\nseed = 9\n'
        '[[camera]]\nkind = "stuck_pixels"\nshare = 0.01\nstart_s = 5\n'
        '[[line]]\nkind = "delay"\ndelay_ms = 50\n'
    )
    assert read_faults(path) == Faults(
        seed=9, camera=(StuckPixels(share=0.01, start_s=5.0),), line=(Delay(delay_ms=50.0),)
    )
    for text, sentence in (
        ('[[line]]\nkind = "delay"\n', "delay_ms"),
        ('[[line]]\nkind = "drop"\nchance = 2\n', "chance"),
        ('[[camera]]\nkind = "gremlins"\n', "gremlins"),
        ('[[camera]]\nkind = "half_frame"\nstart_s = 5\nend_s = 5\n', "end_s above its start_s"),
        ("[[camera", "is not valid TOML"),
    ):
        path.write_text(text)
        with pytest.raises(UserError, match=sentence):
            read_faults(path)
    with pytest.raises(UserError, match="cannot be read"):
        read_faults(tmp_path / "none.toml")


def test_a_line_fault_that_is_added_during_a_run_strikes_from_then_on():
    rows, asked = [], []

    def come():
        asked.append(len(asked))
        # before the fourth frame
        return [Delay(delay_ms=30.0, start_s=0.0)] if len(asked) == 4 else []

    summary = Loop(board(Instant)).run(flight(6), on_row=rows.append, adds_faults=True, new_line_faults=come)
    assert adds_up(summary)
    assert len(asked) == 6
    assert [r.faults for r in rows] == [()] * 3 + [("delay",)] * 3
    assert min(r.e2e_ms for r in rows[3:]) >= 30.0


def even_between(values, low, high):
    """Whether values are spread evenly over an interval and reach both of its ends."""
    u = (np.sort(values) - low) / (high - low)
    assert u[0] >= 0
    assert u[-1] <= 1
    # Kolmogorov-Smirnov at 0.1 %; the ends are reached within ten times their mean distance
    assert np.abs(u - (np.arange(len(u)) + 0.5) / len(u)).max() < 1.95 / np.sqrt(len(u))
    assert u[0] < 10 / len(u)
    assert u[-1] > 1 - 10 / len(u)


def test_jitter_is_between_nothing_and_its_most():
    """On the line and where a flight has no line, for each frame anew."""
    jitter = Jitter(most_ms=40.0, direction="to_host")
    pump = _Pump("to_host", None, None, Faults(seed=3, line=(jitter,)), FaultJournal(), threading.Event())
    added = []
    for k in range(500):
        pose = PoseMessage(frame_id=k, accepted=False, receive_ns=1, start_ns=2, end_ns=3)
        # so far apart that none waits for the one before
        pump._take(Packet(PacketType.POSE, pose.encode()), k * 10**9)
        added.append(1e-6 * (pump._due[-1][0] - k * 10**9))
    even_between(added, 0.0, 40.0)
    link = PoseLink(latency_s=0.25, faults=(jitter,), seed=3)
    even_between([link.delay_s(k, 0.1 * k) for k in range(500)], 0.25, 0.29)
