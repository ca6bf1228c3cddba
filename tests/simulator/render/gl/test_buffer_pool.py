"""Render buffers by size class: each is large enough, and none is leaked."""

import numpy as np

from flyaround.simulator.render.gl.buffer_pool import GRAIN_PX, KEPT, BufferPool


class Counted:
    """Buffers that only count themselves."""

    made = 0
    freed = 0

    def __init__(self, width, height):
        self.size = (width, height)
        Counted.made += 1

    def release(self):
        Counted.freed += 1


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
