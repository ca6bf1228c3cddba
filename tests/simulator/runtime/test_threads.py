"""A program's matrices take one thread, unless the user says otherwise; who works beside a caller leaves it one."""

import os

from flyaround.simulator.runtime import threads
from flyaround.simulator.runtime.threads import share_processors, use_one_for_matrices

NAME = "OPENBLAS_NUM_THREADS"
DRIVER = "LP_NUM_THREADS"


def test_matrices_take_one_thread_where_nobody_has_chosen(monkeypatch):
    monkeypatch.delenv(NAME, raising=False)
    use_one_for_matrices()
    assert os.environ.pop(NAME) == "1"


def test_the_users_choice_is_kept(monkeypatch):
    monkeypatch.setenv(NAME, "3")
    use_one_for_matrices()
    assert os.environ[NAME] == "3"


def test_the_caller_keeps_a_processor_and_somebody_works_beside_it(monkeypatch):
    for processors, beside in ((1, 1), (2, 1), (16, 15)):
        monkeypatch.setattr(threads, "usable_processors", lambda count=processors: count)
        assert threads.helper_threads() == beside


def test_processes_that_draw_at_once_share_the_processors(monkeypatch):
    # (processors, processes): threads of the driver of each; none where a process has but one processor
    shares = {(2, 2): "0", (2, 4): "0", (3, 2): "1", (4, 2): "2", (16, 4): "4", (16, 12): "1", (16, 16): "0"}
    for (processors, processes), share in shares.items():
        monkeypatch.setenv(DRIVER, "")  # noted, so that what is chosen below goes with the test
        monkeypatch.delenv(DRIVER)
        monkeypatch.setattr(threads, "usable_processors", lambda count=processors: count)
        share_processors(processes)
        assert os.environ[DRIVER] == share, (processors, processes)


def test_a_process_that_draws_alone_has_all_and_the_users_number_of_threads_is_kept(monkeypatch):
    monkeypatch.setenv(DRIVER, "")
    monkeypatch.delenv(DRIVER)
    share_processors(1)
    assert DRIVER not in os.environ
    monkeypatch.setenv(DRIVER, "3")
    share_processors(2)
    assert os.environ[DRIVER] == "3"
