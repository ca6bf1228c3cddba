"""Freed images stay with the process: the next ones cost no page faults; what is made of a craft goes with it."""

import gc
import sys
import weakref

import numpy as np
import pytest
from programs import completed

from flyaround.simulator.runtime.memory import cached_per_object

FAULTS = """
import resource, sys
import numpy as np
from flyaround.simulator.runtime.memory import keep_freed_memory
if sys.argv[1] == "kept" and not keep_freed_memory():
    print(-1)
    raise SystemExit
def frame():
    return [np.full((1200, 1920), k, np.float32) for k in range(4)]
frame()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(8):
    frame()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def _faults(how):
    run = completed(sys.executable, "-c", FAULTS, how, check=True)
    return int(run.stdout)


def test_a_frames_memory_is_kept_for_the_next():
    kept = _faults("kept")
    if kept < 0:
        pytest.skip("the C library here has no mallopt")
    # returned and asked for again it is at least a page in each huge page: 8 x 36 MB are over a hundred
    assert kept < 20 < _faults("returned")


class Craft:
    """Something that much is worked out of."""


def test_what_is_made_of_a_craft_lives_as_long_as_the_craft():
    made = []

    @cached_per_object
    def numbers(craft):
        made.append(type(craft))
        return np.arange(3)

    one, other = Craft(), Craft()
    kept = weakref.ref(numbers(one))
    assert numbers(one) is kept()
    assert numbers(other) is not kept()
    assert len(made) == 2
    del one
    gc.collect()
    assert kept() is None
    assert len(numbers(other)) == 3
    assert len(made) == 2
