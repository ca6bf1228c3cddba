"""Times: text to Julian dates and back, leap seconds, years beyond the table of leap seconds."""

import numpy as np
import pytest

from flyaround.simulator.celestial.sea_ice import near_ice
from flyaround.simulator.celestial.seasons import season
from flyaround.simulator.celestial.star_catalogue import stars
from flyaround.simulator.world.time.instant import Instant, nanoseconds_utc


@pytest.mark.parametrize(
    "text",
    [
        "1972-01-01T00:00:00.000000Z",
        "2016-12-31T23:59:60.500000Z",
        "2026-03-20T12:34:56.123456Z",
        "2094-12-31T23:59:59.999999Z",
    ],
)
def test_utc_text_round_trips(text):
    assert Instant.from_utc(text).iso() == text


def test_tt_is_69_184_s_ahead_of_utc():
    """TAI - UTC is 37 s since 2017, TT - TAI 32.184 s."""
    t = Instant.from_utc("2026-03-20T12:00:00Z")
    assert (t.tt1 - 2461120.0 + t.tt2) * 86400 == pytest.approx(69.184, abs=1e-6)


def test_leap_second_is_counted():
    start = Instant.from_utc("2016-12-31T23:59:59Z")
    assert start.plus(1.0).iso() == "2016-12-31T23:59:60.000000Z"
    assert start.plus(2.0).iso() == "2017-01-01T00:00:00.000000Z"
    assert Instant.from_utc("2017-01-01T00:00:00Z").minus(start) == pytest.approx(2.0, abs=1e-6)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("2026-03-20 12:00:00", "of the form"),
        ("2026-03-20T12:00:00", "of the form"),
        ("2026-13-20T12:00:00Z", "not a date"),
        ("2026-02-30T12:00:00Z", "not a date"),
        ("2026-03-20T25:00:00Z", "does not exist"),
        ("2026-03-20T12:00:61Z", "does not exist"),
        ("1066-10-14T12:00:00Z", "outside the years 1972 to 2099"),
    ],
)
def test_invalid_times_are_refused(text, sentence):
    with pytest.raises(ValueError, match=sentence):
        Instant.from_utc(text)


def test_nanoseconds_do_not_run_back_over_a_leap_second():
    start = Instant.from_utc("2016-12-31T23:59:58.5Z")
    texts = [start.plus(0.1 * k).iso() for k in range(40)]
    assert any("23:59:60.5" in text for text in texts)
    times = [nanoseconds_utc(text) for text in texts]
    assert times == sorted(set(times))
    midnight = 1_483_228_800_000_000_000
    assert nanoseconds_utc("2016-12-31T23:59:60Z") == midnight - 1000
    assert nanoseconds_utc("2016-12-31T23:59:60.5Z") == midnight - 500
    assert nanoseconds_utc("2017-01-01T00:00:00.000001Z") == midnight + 1000


def test_the_sky_has_a_leap_second():
    for at in ("2016-12-31T23:59:60.5Z", "2016-12-31T23:59:59.5Z"):
        assert season(at).share == season("2016-12-31T23:59:59Z").share
        assert len(stars(at, "mono").directions) == len(stars("2017-01-01T00:00:00Z", "mono").directions)
        assert near_ice(np.array([0.999]), np.array([0.0]), at).all()
