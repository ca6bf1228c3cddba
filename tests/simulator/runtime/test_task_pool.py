"""Tasks in other processes: results in order, and a sentence where a process is killed from outside."""

import os
import signal

import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.task_pool import run_tasks


def kill_process(_task):
    os.kill(os.getpid(), signal.SIGKILL)


def test_results_come_in_the_order_of_the_tasks():
    assert list(run_tasks(abs, [-3, 1, -2], 2)) == [3, 1, 2]


def test_a_process_killed_from_outside_is_one_sentence():
    with pytest.raises(UserError, match="was killed"):
        list(run_tasks(kill_process, [1, 2], 1))
