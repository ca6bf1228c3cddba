"""An evaluation that is stopped ends at once, with its processes."""

import time
from multiprocessing import active_children

import pytest
import slow_worker

from flyaround.hil.evaluate import dataset_evaluation as run


@pytest.mark.parametrize("how", ["interrupted", "left"])
def test_a_stopped_evaluation_waits_for_no_frame_in_work(monkeypatch, how):
    monkeypatch.setattr(run, "start_worker", slow_worker.begin)
    monkeypatch.setattr(run, "answer_in_worker", slow_worker.sleep)
    others = set(active_children())
    # two tasks go to a process at once: one process has answered, and both are asleep soon
    tasks = [(0.0, "hybrid"), (0.0, "hybrid"), *[(25.0, "hybrid")] * 6]
    answers = run._answers(tasks, ("", "", {}, ()), 2)
    assert next(answers) == tasks[0]
    start = time.monotonic()
    if how == "left":
        answers.close()
    else:
        with pytest.raises(KeyboardInterrupt):
            answers.throw(KeyboardInterrupt())
    while set(active_children()) - others and time.monotonic() - start < 20.0:
        time.sleep(0.02)
    # an answer takes 25 s, a signal none
    assert time.monotonic() - start < 20.0
