"""Freed images stay with the process: the next ones cost no page faults."""

import subprocess
import sys

import pytest

FAULTS = """
import resource, sys
import numpy as np
from simulator.memory import keep_freed_memory
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


def _faults(how: str) -> int:
    run = subprocess.run([sys.executable, "-c", FAULTS, how], capture_output=True, text=True, check=True)
    return int(run.stdout)


def test_a_frames_memory_is_kept_for_the_next():
    kept = _faults("kept")
    if kept < 0:
        pytest.skip("the C library here has no mallopt")
    # returned and asked for again it is at least a page in each huge page: 8 x 36 MB are over a hundred
    assert kept < 20 < _faults("returned")
