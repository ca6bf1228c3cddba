"""Tasks in other processes: results in order, and a sentence where a process is ended from outside."""

import os
import signal

import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.task_pool import run_tasks


def end_from_outside(_task):
    os.kill(os.getpid(), signal.SIGKILL)


def test_results_come_in_the_order_of_the_tasks():
    assert list(run_tasks(abs, [-3, 1, -2], 2)) == [3, 1, 2]


def test_a_process_that_is_ended_from_outside_is_one_sentence():
    with pytest.raises(UserError, match="ended from outside"):
        list(run_tasks(end_from_outside, [1, 2], 1))
