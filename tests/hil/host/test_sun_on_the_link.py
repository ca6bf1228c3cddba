"""Optional fields on the link: the direction to the Sun to boards that take it, if it is asked for; covariance back."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from estimators import PATIENCE_S, Estimate
from hand_made_host import hand_made_host, in_thread
from hil_loop import Loop, Proxy, adds_up, frames, scene

from flyaround.hil.board import agent
from flyaround.hil.board.agent import describe_board, run_board
from flyaround.hil.host.ledger.run_terms import read_terms
from flyaround.hil.link.packets.enums import Transfer
from flyaround.simulator.errors import UserError


class SunReader:
    """Declines what comes without a Sun; says a Sun as a place, and a covariance."""

    takes_sun = True

    def __init__(self, _camera):
        pass

    def estimate(self, _image, sun_camera=None):
        result = Estimate()
        result.accepted = sun_camera is not None
        result.t_camera_from_target_m = sun_camera or (0.0, 0.0, 1.0)
        result.covariance = np.diag([2.0**-10] * 3 + [0.25] * 3)
        return result


sun_board = partial(run_board, make_estimator=SunReader, silence_s=PATIENCE_S)


def places(rows):
    return [row.t_m for row in rows if row.outcome == "accepted"]


@pytest.mark.parametrize("asked", [False, True])
def test_the_sun_goes_out_only_if_it_is_asked_for(tmp_path, asked):
    rows = []
    summary = Loop(sun_board).run(frames(3), log_dir=tmp_path, send_sun=asked, on_row=rows.append)
    assert adds_up(summary)
    assert (summary.sent, summary.dropped_total) == (3, 0)
    assert places(rows) == [pytest.approx(scene().sun_direction_camera, abs=1e-12)] * (3 if asked else 0)
    assert read_terms(tmp_path).sun_sent == asked


def test_a_board_that_takes_no_fields_gets_frames_as_before(tmp_path, monkeypatch):
    # a board of before this option: its HELLO has no such bit, and a longer FRAME_HEADER would be a mistake to it
    def old(*words, **options):
        return replace(describe_board(*words, **options), takes_fields=False)

    monkeypatch.setattr(agent, "describe_board", old)
    sent = []

    def seen(_k, kind, data):
        sent.append((kind.name, len(data)))
        return data

    proxy = Proxy(seen)
    proxy.board = sun_board
    rows = []
    summary = Loop(proxy).run(frames(3), log_dir=tmp_path, send_sun=True, on_row=rows.append)
    assert (summary.sent, summary.dropped_total, places(rows)) == (3, 0, [])
    # length prefix, header, 120 bytes and CRC
    assert {size for kind, size in sent if kind == "FRAME_HEADER"} == {4 + 24 + 120 + 4}
    assert not read_terms(tmp_path).sun_sent


@pytest.mark.parametrize("takes", [False, True])
def test_covariance_goes_back_only_to_hosts_that_take_it(takes):
    with hand_made_host() as host:
        thread, _ = in_thread(sun_board, host.url)
        assert host.meet(takes_fields=takes).takes_fields
        host.send_frame(0)
        covariance = host.pose().covariance
        host.link.close("the run is over")
        thread.join(PATIENCE_S)
    assert (covariance is not None) == takes
    if covariance is not None:
        full = np.zeros((6, 6))
        full[np.triu_indices(6)] = covariance
        assert np.array_equal(full, np.diag([2.0**-10] * 3 + [0.25] * 3))


class LevelReader(SunReader):
    """Says the level of a picture as a place."""

    def estimate(self, image, sun_camera=None):
        result = super().estimate(image, sun_camera)
        result.accepted, result.t_camera_from_target_m = True, (0.0, 0.0, float(image[0, 0]))
        return result


@pytest.mark.parametrize("transfer", list(Transfer))
def test_an_estimator_is_handed_linear_pixels(transfer):
    board = partial(run_board, make_estimator=LevelReader, silence_s=PATIENCE_S)
    with hand_made_host() as host:
        thread, _ = in_thread(board, host.url)
        host.meet(takes_fields=True)
        host.send_frame(0, level=188, transfer=transfer)
        level = host.pose().t_camera_from_target_m[2]
        host.link.close("the run is over")
        thread.join(PATIENCE_S)
    # 188 of sRGB is half of the light (IEC 61966-2-1)
    assert level == {Transfer.LINEAR: 188, Transfer.SRGB: 128, Transfer.GAMMA: 130}[transfer]


def encoded(count):
    for frame in frames(count):
        yield replace(frame, scene=replace(frame.scene, camera=replace(frame.scene.camera, encoding="srgb")))


@pytest.mark.filterwarnings(
    "ignore::pytest.PytestUnhandledThreadExceptionWarning"
)  # the board says why it ends
def test_encoded_pictures_go_only_to_boards_that_are_told_so(monkeypatch):
    board, rows = partial(run_board, make_estimator=LevelReader, silence_s=PATIENCE_S), []
    summary = Loop(board).run(encoded(2), on_row=rows.append)
    assert (summary.sent, summary.dropped_total) == (2, 0)

    def old(*words, **options):
        return replace(describe_board(*words, **options), takes_fields=False)

    monkeypatch.setattr(agent, "describe_board", old)
    with pytest.raises(UserError, match="pixels are srgb, which this board cannot read"):
        Loop(board).run(encoded(2), connect_timeout_s=3.0)
