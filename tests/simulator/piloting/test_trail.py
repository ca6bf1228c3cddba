"""The trail of a long flight: thinned, in order, cut where the flight goes another way."""

from flyaround.simulator.piloting.look_back import MAX_TRAIL_POINTS, TRAIL_INTERVAL_S, Trail


def test_a_long_flight_is_thinned_and_stays_whole():
    trail, t_s, end_s = Trail(), 0.0, 3 * MAX_TRAIL_POINTS * TRAIL_INTERVAL_S
    while t_s < end_s:
        if trail.is_due(t_s):
            trail.add(t_s, (t_s, 0.0, 0.0))
        t_s += TRAIL_INTERVAL_S / 2
    assert MAX_TRAIL_POINTS / 2 <= len(trail.points) <= MAX_TRAIL_POINTS
    at = [p[0] for p in trail.points]
    assert at == sorted(at)
    assert at[0] == 0.0
    assert at[-1] > end_s - 8 * TRAIL_INTERVAL_S


def test_what_is_later_is_forgotten_and_replaced():
    trail = Trail()
    for t_s in range(10):
        trail.add(float(t_s), (float(t_s), 0.0, 0.0))
    trail.cut(4.0)
    assert [p[0] for p in trail.points] == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert not trail.is_due(4.2)
    assert trail.is_due(4.6)
    trail.replace([(0.0, (7.0, 0.0, 0.0)), (9.0, (8.0, 0.0, 0.0))])
    assert [p[0] for p in trail.points] == [7.0, 8.0]
    assert not trail.is_due(9.1)
