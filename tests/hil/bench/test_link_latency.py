"""The link's bench measures answered frames alone."""

import pytest

from flyaround.hil.bench import link_latency


def test_each_frame_has_a_latency():
    laps_ms = link_latency.link_latency_ms(64, 48, n_frames=4)
    assert len(laps_ms) == 4
    assert all(0 < ms < 60_000 for ms in laps_ms)


def test_a_board_without_poses_has_no_latency(monkeypatch):
    def fail(_self, _image):
        raise ValueError("no pose today")

    monkeypatch.setattr(link_latency._Answer, "estimate", fail)
    with pytest.raises(RuntimeError, match=r"3 of 3 frames have no pose: .*no pose today"):
        link_latency.link_latency_ms(64, 48, n_frames=3)
