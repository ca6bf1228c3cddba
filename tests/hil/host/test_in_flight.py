"""Which frames are in flight and which use up credit, to the nanosecond and to the frame."""

import pytest

from flyaround.hil.host.frame_record import FrameRecord
from flyaround.hil.host.link_process.in_flight import FramesInFlight
from flyaround.hil.link.packets.messages import NO_FRAME, PoseMessage

SENT_NS = 5_000_000_000
TIMEOUT_NS = 2_000_000_000


class Sky:
    """FramesInFlight with frames 0 to 4 sent a millisecond apart, and what was reported of them."""

    def __init__(self, n=5):
        self.results, self.sent = [], {}
        self.flights = FramesInFlight(self.results.append, TIMEOUT_NS * 1e-9)
        for k in range(n):
            record = FrameRecord(frame_id=k, epoch_utc="2026-01-01T00:00:00Z", t_s=0.0, exposure_s=0.01)
            self.sent[k] = self.flights.start(record, SENT_NS + k * 1_000_000)

    @property
    def outcomes(self):
        assert len({r.frame_id for r in self.results}) == len(self.results)  # each once
        return {r.frame_id: r.outcome for r in self.results}


def pose(frame_id, *, accepted=True):
    return PoseMessage(frame_id, accepted, "", (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0))


def test_a_frame_is_out_of_time_at_its_deadline_and_not_before():
    sky = Sky()
    deadline = SENT_NS + TIMEOUT_NS
    assert sky.flights.first_deadline_ns == deadline
    sky.flights.expire(deadline - 1)
    assert sky.outcomes == {}
    # at the very nanosecond that the link process sleeps until: otherwise it would wake and find nothing to do
    sky.flights.expire(deadline)
    assert sky.outcomes == {0: "dropped:timeout"}
    assert sky.flights.first_deadline_ns == deadline + 1_000_000
    sky.flights.expire(deadline + 4_000_000)
    assert len(sky.outcomes) == 5
    assert sky.flights.first_deadline_ns is None


@pytest.mark.parametrize("frame_id", range(5))
def test_a_release_reaches_its_own_frame_and_no_later_one(frame_id):
    sky = Sky()
    sky.flights.release(frame_id)
    assert sky.outcomes == dict.fromkeys(range(frame_id + 1), "dropped:skipped")
    assert sky.flights.held == 4 - frame_id


@pytest.mark.parametrize("frame_id", range(5))
def test_a_pose_answers_its_frame_and_releases_those_before(frame_id):
    sky = Sky()
    assert sky.flights.answer(pose(frame_id), SENT_NS + 1, 17)
    assert sky.outcomes == {**dict.fromkeys(range(frame_id), "dropped:skipped"), frame_id: "accepted"}
    assert sky.flights.held == 4 - frame_id
    assert not sky.flights.answer(pose(frame_id), SENT_NS + 2, 17)
    assert len(sky.results) == frame_id + 1


def test_a_timeout_keeps_the_credit_that_damage_gives_back():
    sky = Sky(2)
    sky.flights.expire(SENT_NS + TIMEOUT_NS)
    assert sky.flights.held == 2  # the board may still be at work on it
    sky.flights.note_damage()
    sky.flights.expire(SENT_NS + TIMEOUT_NS + 1_000_000)
    assert sky.outcomes == {0: "dropped:timeout", 1: "dropped:corrupt"}
    assert sky.flights.held == 1  # the second may never have reached it


def test_a_frame_that_ran_out_of_time_is_released_by_word_of_its_damage():
    sky = Sky(2)
    sky.flights.expire(SENT_NS + TIMEOUT_NS)
    assert (sky.flights.held, sky.flights.misses) == (2, 1)
    assert not sky.flights.damaged(0, "late, but a word")
    assert (sky.flights.held, sky.flights.misses) == (1, 0)
    assert sky.outcomes == {0: "dropped:timeout"}


def test_an_answer_that_cannot_be_used_drops_its_frame_and_releases_it():
    sky = Sky(3)
    assert sky.flights.refuse(1, "the quaternion has length 2")
    assert sky.outcomes == {1: "dropped:protocol", 0: "dropped:skipped"}
    assert sky.results[0].reason == "the quaternion has length 2"
    assert sky.flights.held == 1
    assert not sky.flights.refuse(1, "again")
    assert not sky.flights.refuse(99, "a frame that was never sent")
    assert sky.flights.held == 1
    # one that ran out of time before its useless answer came holds no credit either
    sky.flights.expire(SENT_NS + TIMEOUT_NS + 5_000_000)
    assert sky.flights.held == 1
    assert not sky.flights.refuse(2, "late")
    assert sky.flights.held == 0
    assert sky.outcomes[2] == "dropped:timeout"


def test_frames_that_the_board_never_got_whole_are_given_up_once_it_was_asked():
    sky = Sky(3)
    for k, flight in sky.sent.items():
        if k < 2:
            sky.flights.sent(flight, SENT_NS + 10 + k)
    # asked before frame 1 was out: it may come yet
    sky.flights.drop_unreceived(SENT_NS + 11, NO_FRAME)
    assert sky.outcomes == {0: "dropped:lost"}
    # and the board has 1; 2 is still being sent
    sky.flights.drop_unreceived(SENT_NS + 20, 1)
    assert sky.outcomes == {0: "dropped:lost"}
    assert sky.flights.held == 2
    # one that ran out of time gives its credit back as well
    sky.flights.sent(sky.sent[2], SENT_NS + 30)
    sky.flights.expire(SENT_NS + TIMEOUT_NS + 5_000_000)
    assert (sky.flights.held, sky.flights.misses) == (2, 2)
    sky.flights.drop_unreceived(SENT_NS + 40, 1)
    assert (sky.flights.held, sky.flights.misses) == (1, 0)
    assert sky.outcomes[2] == "dropped:timeout"


def test_a_miss_is_a_frame_that_was_sent_or_a_whole_time_out_of_silence_after_one():
    sky = Sky(1)
    flights, deadline = sky.flights, SENT_NS + TIMEOUT_NS
    assert flights.unanswered(deadline - 1) == 0
    assert flights.unanswered(deadline) == 1
    flights.expire(deadline)
    # whatever the camera hands over meanwhile
    assert flights.unanswered(deadline + TIMEOUT_NS - 1) == 1
    assert flights.unanswered(deadline + TIMEOUT_NS) == 2
    assert flights.unanswered(deadline + 2 * TIMEOUT_NS) == 3
    flights.answer(pose(0), deadline + 2 * TIMEOUT_NS, None)
    assert flights.unanswered(deadline + 9 * TIMEOUT_NS) == 0
