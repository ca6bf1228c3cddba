"""One capture at a time in a folder."""

import errno
import subprocess
import sys

import pytest

from flyaround.simulator.dataset import capture as capturing
from flyaround.simulator.errors import UserError
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.runtime import folder_lock
from flyaround.simulator.runtime.folder_lock import lock_name, only_writer

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs locks of files")
PLAN = plan_recipe("eval-black", 1, target="tango@low")
HOLD = """
import sys, time
from pathlib import Path
from flyaround.simulator.runtime.folder_lock import only_writer
with only_writer(Path(sys.argv[1]), "capture"):
    print("locked", flush=True)
    time.sleep(100)
"""


def test_a_second_capture_into_a_folder_is_refused_in_one_sentence_and_a_dead_one_is_no_obstacle(tmp_path):
    with subprocess.Popen([sys.executable, "-c", HOLD, tmp_path], stdout=subprocess.PIPE, text=True) as first:
        assert first.stdout.readline() == "locked\n"
        for resume in (False, True):
            with pytest.raises(UserError, match="another capture is writing into"):
                capturing.capture(PLAN, tmp_path, resume=resume)
        first.kill()
    assert (tmp_path / lock_name("capture")).exists()  # as a killed one leaves it
    with only_writer(tmp_path, "capture"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_capture_left_alone_is_an_empty_folder(tmp_path, monkeypatch):
    (tmp_path / lock_name("capture")).write_text("")
    monkeypatch.setattr(capturing, "_capture", lambda *_, **__: "drawn")
    assert capturing.capture(PLAN, tmp_path) == "drawn"
    (tmp_path / "mine.txt").write_text("")
    with pytest.raises(UserError, match="not empty"):
        capturing.capture(PLAN, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_full_disk_is_said_as_one(tmp_path, monkeypatch):
    def full(path, *_):
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    with monkeypatch.context() as patch:
        patch.setattr(folder_lock.os, "open", full)
        with pytest.raises(UserError, match="no space left on its disk"), only_writer(tmp_path, "capture"):
            pass


RACE = """
import sys, time
from pathlib import Path
from flyaround.simulator.runtime.folder_lock import only_writer
from flyaround.simulator.errors import UserError
folder, got, until = Path(sys.argv[1]), 0, time.monotonic() + 20
while got < 150 and time.monotonic() < until:
    try:
        with only_writer(folder, "capture"):
            (folder / "alone").mkdir()  # fails where another is within
            (folder / "alone").rmdir()
            got += 1
    except UserError:
        pass
print(got)
"""


def test_two_that_come_and_go_are_never_both_within(tmp_path):
    """A lock file that is taken away must not leave one process with the old and one with the new."""
    both = [
        subprocess.Popen([sys.executable, "-c", RACE, tmp_path], stdout=subprocess.PIPE) for _ in range(2)
    ]
    assert all(int(one.communicate(timeout=100)[0]) > 0 for one in both)
