"""Time and memory of a new process until its first frame, with an empty and a full cache."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import time
from tempfile import TemporaryDirectory

from flyaround.simulator.bench.parts import PartCost, cost

SCENE = "tango-earth-10m-1024"
# in the order of `flyaround render`: decoding the maps starts before the renderer is imported
_PROGRAM = f"""
import sys
from flyaround.simulator.runtime.memory import keep_freed_memory
from flyaround.simulator.runtime.threads import use_one_for_matrices
keep_freed_memory()  # as the program does
use_one_for_matrices()
{{early}}
from flyaround.simulator.render.earth.map_textures import prefetch_earth_maps
from flyaround.simulator.scenario.load import load_scenario
scenario = load_scenario("{SCENE}")
bands = scenario.output.bands
prefetched = prefetch_earth_maps(bands, scenario.environment.layers(), scenario.epoch_utc)
from flyaround.simulator.frame import take_frame
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.render.renderer import Renderer
{{late}}
plan = plan_flight(scenario, n=1)
with Renderer(prefetched={{bands: prefetched}}) as renderer:
    take_frame(renderer, plan.scene(0), plan.target, labels=False)
    print("frame", flush=True)
    status = open("/proc/self/status").read() if sys.platform == "linux" else ""
    print(next((line.split()[1] for line in status.splitlines() if line.startswith("VmHWM")), "0"))
"""


def bench_start() -> tuple[PartCost, ...]:
    """Time the start of Python until an image, with an empty and with a full cache.

    Returns
    -------
    tuple of PartCost
        Costs of the first and of the second start; their peak is the resident memory [MB], including mapped files.
    """
    with TemporaryDirectory() as folder:
        first, second = (start_once(folder) for _ in range(2))
    return (
        cost("start to first frame, the first time", [first[0]], peak_mb=first[1]),
        cost("start to first frame", [second[0]], peak_mb=second[1]),
    )


def start_once(cache_folder: str, early: str = "", late: str = "") -> tuple[float, float | None]:
    """Return the time to a first frame [ms] and the peak memory [MB] of a process with a cache of its own.

    Parameters
    ----------
    cache_folder : str
        Folder of the process's cache.
    early : str, optional
        Python code to run before anything is imported.
    late : str, optional
        Python code to run after the renderer is imported.

    Returns
    -------
    tuple of float
        Time [ms], and memory [MB], None where it is not known.

    Raises
    ------
    RuntimeError
        If the process fails.
    """
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}  # as installed
    # the first start also compiles the driver's shaders
    caches = {"FLYAROUND_CACHE_DIR": cache_folder, "MESA_SHADER_CACHE_DIR": f"{cache_folder}/shaders"}
    command = [sys.executable, "-c", _PROGRAM.replace("{early}", early).replace("{late}", late)]
    start = time.perf_counter()
    with subprocess.Popen(
        command, env={**environment, **caches}, stdout=subprocess.PIPE, text=True
    ) as program:
        out = program.stdout or io.StringIO()
        first = out.readline()
        elapsed_ms = (time.perf_counter() - start) * 1e3  # without waiting for its end
        remaining = out.read()
    if program.returncode != 0 or first.strip() != "frame":
        raise RuntimeError(f"the program that draws a first frame ended with {program.returncode}")
    return elapsed_ms, float(remaining) * 1024e-6 or None  # the kernel's kB has 1024 bytes
