"""A program's matrices take one thread, unless the user says otherwise."""

import os

from simulator.threads import use_one_for_matrices

NAME = "OPENBLAS_NUM_THREADS"


def test_matrices_take_one_thread_where_nobody_has_chosen(monkeypatch):
    monkeypatch.delenv(NAME, raising=False)
    use_one_for_matrices()
    assert os.environ.pop(NAME) == "1"


def test_the_users_choice_is_kept(monkeypatch):
    monkeypatch.setenv(NAME, "3")
    use_one_for_matrices()
    assert os.environ[NAME] == "3"
