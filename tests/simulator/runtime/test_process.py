"""The renderer in its own process: order, errors, crash, clean end."""

import itertools
import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.loop import OpenRenderer
from flyaround.simulator.runtime import worker
from flyaround.simulator.runtime.worker import WorkerProcess

pytestmark = pytest.mark.gl


def draw(renderer, scene, *, target, scale=1.0):
    image = renderer.render(scene, target).radiance
    return scene.frame_index, image * np.float32(scale)


def fail(renderer, scene, *, how):
    if how == "user":
        raise UserError("the lens cap is on; take it off")
    if how == "die":
        os._exit(7)
    raise ValueError("a bug")


@pytest.fixture(scope="module")
def target(draw_kit):
    return draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])


def test_results_in_order_and_equal_to_ours(renderer, draw_kit, target):
    scenes = [draw_kit.scene(target, frame_index=k, t_m=(0.1 * k, 0, 5)) for k in range(5)]
    with WorkerProcess(draw, open_resource=OpenRenderer(first=scenes[0]), capacity=2) as process:
        assert process.info == renderer.info
        results = []
        for scene in scenes:
            if not process.has_room:
                results.append(process.result())
            process.submit(scene, target=target)
        results += process.results()
        process.submit(scenes[0], target=target, scale=2.0)
        process.submit(scenes[1], target=target)
        assert not process.has_room
        with pytest.raises(RuntimeError, match="in flight"):
            process.submit(scenes[2], target=target)
        assert process.ready(120)
        _, doubled = process.result()
        # one job is left behind on purpose: closing must not hang
    assert [index for index, _ in results] == [0, 1, 2, 3, 4]
    for scene, (_, image) in zip(scenes, results, strict=True):
        assert np.array_equal(image, renderer.render(scene, target).radiance)
    assert np.array_equal(doubled, 2 * results[0][1])


def test_errors_come_back_as_themselves(draw_kit, target):
    scene = draw_kit.scene(target)
    with WorkerProcess(fail, open_resource=OpenRenderer()) as process:
        process.submit(scene, how="user")
        with pytest.raises(UserError, match="lens cap"):
            process.result()
        process.submit(scene, how="bug")
        with pytest.raises(RuntimeError, match="ValueError: a bug"):
            process.result()
        process.submit(scene, how="die")
        with pytest.raises(RuntimeError, match="exit code 7"):
            process.result()


def test_a_renderer_that_cannot_start_says_why(draw_kit, target):
    with WorkerProcess(draw, open_resource=OpenRenderer(device_index=97)) as process:
        process.submit(draw_kit.scene(target), target=target)
        with pytest.raises(UserError, match="device 97"):
            process.result()


def hold(renderer, scene, *, until):
    """Draw nothing, for as long as a file is there; the first result is large enough for shared memory."""
    if not until:
        return os.getpid(), np.zeros(1 << 20, np.uint8)
    while Path(until).exists():
        time.sleep(0.01)
    return None


def gone(pid):
    """Whether a process has ended, or is a zombie that somebody has still to ask for."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except OSError:
        return True


def wait_until(condition):
    deadline = time.monotonic() + 60.0
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


class Opens:
    """A resource that takes so long to open [s]."""

    info = "open"

    def __init__(self, lasts_s):
        self.lasts_s = lasts_s

    def __call__(self):
        return self

    def __enter__(self):
        time.sleep(self.lasts_s)
        return self

    def __exit__(self, *_):
        pass


def test_a_process_that_works_may_take_long_to_start_and_one_that_does_nothing_is_told(monkeypatch):
    """As on a crowded machine, where starting takes longer than anyone should wait for a process that hangs."""
    assert worker._processor_time_s(os.getpid()) > 0
    monkeypatch.setattr(worker, "_START_TIMEOUT_S", 0.2)
    ticks = itertools.count(1.0)
    monkeypatch.setattr(worker, "_processor_time_s", lambda _pid: next(ticks))
    with WorkerProcess(fail, open_resource=Opens(1.0)) as process:
        assert process.info == "open"
    monkeypatch.setattr(worker, "_processor_time_s", lambda _pid: 7.0)
    with (
        WorkerProcess(fail, open_resource=Opens(60.0)) as process,
        pytest.raises(RuntimeError, match="did not start: it has done nothing"),
    ):
        _ = process.info


def test_a_frame_in_work_is_given_up(draw_kit, target, tmp_path):
    busy = tmp_path / "busy"
    busy.touch()
    with WorkerProcess(hold, open_resource=OpenRenderer()) as process:
        process.submit(draw_kit.scene(target), until="")
        pid, _ = process.result()
        process.submit(draw_kit.scene(target), until=str(busy))
        start = time.monotonic()
    # it would hold on until the file is gone, which it never is
    assert time.monotonic() - start < 30.0
    assert gone(pid)


PARENT = """
import pickle, sys, time
sys.path.insert(0, sys.argv[1])
import test_process as here
from flyaround.simulator.loop import OpenRenderer
from flyaround.simulator.runtime import worker
from flyaround.simulator.runtime.worker import WorkerProcess
if __name__ == "__main__":
    scene = pickle.loads(open(sys.argv[2], "rb").read())
    with WorkerProcess(here.hold, open_resource=OpenRenderer()) as process:
        process.submit(scene, until="")
        pid, _ = process.result()
        process.submit(scene, until=sys.argv[2])
        print(pid, flush=True)
        time.sleep(300)
"""


def test_a_renderer_does_not_outlive_who_made_it(draw_kit, target, tmp_path):
    scene = tmp_path / "scene"
    scene.write_bytes(pickle.dumps(draw_kit.scene(target)))
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    command = [sys.executable, str(script), str(Path(__file__).parent), str(scene)]
    parent = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        pid = int(parent.stdout.readline())
        parent.send_signal(signal.SIGKILL)
        parent.wait(timeout=60.0)
        assert wait_until(lambda: gone(pid))
        # nothing that Python would have to free after it
        assert parent.stderr.read() == ""
    finally:
        parent.kill()
        parent.communicate()


ENDS = """
import os, signal, sys
import numpy as np
from flyaround.simulator.runtime.worker import WorkerProcess

class Nothing:
    info = "open"
    def __enter__(self): return self
    def __exit__(self, *_): pass

def zeros(_nothing, size): return np.zeros(size, np.uint8)

def stopped(process): os.kill(process.pid, signal.SIGSTOP)  # it can free nothing itself
def killed(process): os.kill(process.pid, signal.SIGKILL)
def killed_and_gone(process): process.kill()
def closed(process): pass

if __name__ == "__main__":
    for how in (stopped, killed, killed_and_gone, closed):
        with WorkerProcess(zeros, open_resource=Nothing) as process:
            process.submit(1 << 20)
            assert process.info == "open"
            assert process.ready(60.0)
            how(process)
"""


def test_a_result_that_nobody_collects_leaves_no_memory_behind(tmp_path):
    """In a program of its own: what it leaves is told by Python at its end."""
    script = tmp_path / "ends.py"
    script.write_text(ENDS)
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False, timeout=120
    )
    assert (done.returncode, done.stderr) == (0, "")


def summed(_opened, array, scale):
    return array.sum(), array * scale


def test_arrays_of_any_size_go_there_and_come_back_whole():
    """Each in the memory of one before it: smaller, larger, through the message alone."""
    sizes = [0, 10, 1 << 17, 1 << 20, 1 << 16, 3, 1 << 21, 1 << 18]
    arrays = [np.arange(size, dtype=np.uint32) + k for k, size in enumerate(sizes)]
    with WorkerProcess(summed, open_resource=Opens(0.0), capacity=3) as process:
        results = []
        for array in arrays:
            if not process.has_room:
                results.append(process.result())
            process.submit(array, scale=np.uint32(3))
        results.append(process.result())
        # one that cannot be sent takes nobody's place
        with pytest.raises((AttributeError, pickle.PicklingError), match=r"pickle|local object"):
            process.submit(lambda: 0)
        results += process.results()
    for array, (total, tripled) in zip(arrays, results, strict=True):
        assert total == array.sum()
        assert np.array_equal(tripled, array * np.uint32(3))


def spin(_resource, path):
    while path.exists():
        pass


def test_a_worker_tells_the_processor_time_that_it_uses(tmp_path):
    busy = tmp_path / "busy"
    busy.touch()
    with WorkerProcess(spin, open_resource=Opens(0.0)) as process:
        process.submit(busy)
        at_first = process.processor_time_s()
        deadline = time.monotonic() + 120.0
        while process.processor_time_s() <= at_first + 0.2 and time.monotonic() < deadline:
            time.sleep(0.02)
        assert process.processor_time_s() > at_first + 0.2
        busy.unlink()
        process.result()


class CannotOpen:
    """A resource whose opening raises an error of the kinds that a broken pipe raises too."""

    def __init__(self, error):
        self.error = error

    def __call__(self):
        raise self.error


@pytest.mark.parametrize(
    "error", [EOFError("truncated texture"), ConnectionRefusedError("no licence server")]
)
def test_an_error_at_opening_is_reported_whatever_its_kind(error):
    with (
        WorkerProcess(fail, open_resource=CannotOpen(error)) as process,
        pytest.raises(RuntimeError, match=f"{type(error).__name__}: {error}"),
    ):
        _ = process.info


def answer(_opened, how):
    if how == "pipe":
        raise BrokenPipeError("of the job, not of the worker")
    return (lambda: 0) if how == "local" else how


def test_jobs_go_on_after_one_with_a_pipe_error_or_a_result_that_cannot_be_sent():
    with WorkerProcess(answer, open_resource=Opens(0.0)) as process:
        for how, message in (("pipe", "of the job"), ("local", "answer.<locals>")):
            process.submit(how)
            with pytest.raises(RuntimeError, match=message):
                process.result()
        process.submit("well")
        assert process.result() == "well"


class OpensSilently(Opens):
    """A resource without a description."""

    info = None


def test_info_may_be_none():
    with WorkerProcess(answer, open_resource=OpensSilently(0.0)) as process:
        process.submit(1)
        process.submit(2)
        assert list(process.results()) == [1, 2]
        assert process.info is None


def test_a_failed_start_leaves_no_descriptor_open():
    before = set(Path("/proc/self/fd").iterdir())
    with pytest.raises((AttributeError, pickle.PicklingError), match=r"pickle|local object"):
        WorkerProcess(answer, open_resource=lambda: Opens(0.0))
    assert set(Path("/proc/self/fd").iterdir()) <= before
