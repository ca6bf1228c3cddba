"""Buffers by size class: few are made, none is much too large."""

import numpy as np

from flyaround.simulator.render.gl.buffer_pool import GRAIN_PX, KEPT, LARGER, BufferPool


class Counted:
    """Buffers that only count themselves."""

    made = 0
    freed = 0

    def __init__(self, width, height):
        self.size = (width, height)
        Counted.made += 1

    def release(self):
        Counted.freed += 1


def test_windows_about_a_step_of_the_classes_share_a_buffer():
    Counted.made = Counted.freed = 0
    classes = BufferPool(Counted)
    # a craft that turns: its window's sides pass the steps of both classes to and fro
    for k in range(40):
        width, height = 18 * GRAIN_PX + 5 * (k % 3 - 1), 29 * GRAIN_PX + 4 * (k % 5 - 2)
        buffers = classes.at_least(width, height)
        assert buffers.size[0] >= width
        assert buffers.size[1] >= height
    assert Counted.made <= 4
    assert Counted.made - Counted.freed == 1
    # one much smaller is not drawn into the large buffer, which takes long to clear
    small = classes.at_least(3 * GRAIN_PX - 1, 3 * GRAIN_PX)
    assert small.size[0] * small.size[1] <= LARGER * 9 * GRAIN_PX**2


def test_sizes_at_hand_have_an_area_together():
    Counted.made = Counted.freed = 0
    side = 4 * GRAIN_PX
    classes = BufferPool(Counted, 2.4 * side**2)
    first = classes.at_least(side, side)
    classes.at_least(side, side // 2)
    assert classes.at_least(side, side) is first
    # a third of the same area is too much: the one not used for longest goes, and it is enough
    classes.at_least(side // 2, 2 * side)
    assert (Counted.made, Counted.freed) == (3, 1)
    assert classes.at_least(side, side) is first
    # one alone may have more
    huge = classes.at_least(3 * side, 2 * side)
    assert classes.at_least(3 * side, 2 * side) is huge
    assert Counted.made - Counted.freed == 1


def test_no_buffer_is_lost_where_another_grown_to_the_class_would_have_the_same_area():
    # each is freed by hand: one that is put out of the books without it stays for ever
    windows = [(4, 2), (3, 4), (4, 3), (3, 3)]
    rng = np.random.default_rng(3)
    windows += [tuple(int(k) for k in side) for side in rng.integers(1, 6, (400, 2))]
    Counted.made = Counted.freed = 0
    classes = BufferPool(Counted)
    for width, height in windows:
        buffers = classes.at_least(width * GRAIN_PX, height * GRAIN_PX)
        assert buffers.size[0] >= width * GRAIN_PX
        assert buffers.size[1] >= height * GRAIN_PX
        assert Counted.made - Counted.freed <= KEPT
