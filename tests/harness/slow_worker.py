"""What a pool of processes is given to do that takes long: for tests that stop it."""

from __future__ import annotations

import time


def begin(*_setting: object) -> None:
    """Nothing to prepare."""


def sleep(task: tuple[float, str]) -> tuple[float, str]:
    """The task, after as many seconds as it says."""
    time.sleep(task[0])
    return task
