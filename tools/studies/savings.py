"""Gain of each shortcut of the software path: bench scenes with all of them and with one disabled, alternately.

`python -m tools.studies.savings [NAME...]` renders with all shortcuts and without each named one, and prints the
additional processor time per frame [ms] by scene, the sum, and the maximum difference of the images.
`python -m tools.studies.savings --start [NAME...]` does so for the first start of a process, with an empty cache [s].
Results, and shortcuts that were removed: docs/lab/2026-11-savings.md.
"""

from __future__ import annotations

import sys
import time
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.bench.scenes import BENCH_SCENES, bench_views
from flyaround.simulator.bench.start import start_once
from flyaround.simulator.frame import take_frame
from flyaround.simulator.render import frame_graph
from flyaround.simulator.render.craft import viewport_fit, visible_edges, visible_triangles
from flyaround.simulator.render.craft.mesh_array import WholeMesh
from flyaround.simulator.render.earth import earth_pass
from flyaround.simulator.render.earth.earth_view import EarthTilesPass
from flyaround.simulator.render.gl import depth_buffer
from flyaround.simulator.render.gl.uniform_block import UniformBlock
from flyaround.simulator.render.globe import frame_air
from flyaround.simulator.render.projection import PixelRect
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.render.sky.star_pass import StarPass
from flyaround.simulator.render.software import smooth_earth, software_path, tiles
from flyaround.simulator.runtime.memory import keep_freed_memory

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from flyaround.simulator.render.frame_images import FrameImages
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray

SCENES = BENCH_SCENES[:8]
TURNS, WARM_UP = 15, 2  # timed and untimed frames per scene and variant
STARTS = 7  # number of program starts per variant
_MANY = 10**9  # larger than any count
_RAYS: Any = vars(tiles)["_CornerRays"]
_CULLING = software_path.TileCulling
_EARTH, _BLOCK = smooth_earth.SmoothEarthPass, UniformBlock


def _changed(owner: object, name: str, after: Any) -> tuple[object, str, object]:  # noqa: ANN401
    """Return a patch of a function whose result and arguments are passed to ``after``."""
    before = vars(owner)[name]
    return owner, name, lambda *a, **k: after(before(*a, **k), *a)


def _all_hidden(_self: StarPass, pixels: FloatArray, images: FrameImages, _target: object) -> BoolArray:
    images.mark_drawn(PixelRect(0, 0, *images.size))
    return np.ones(len(pixels), bool)


WITHOUT: dict[str, list[tuple[object, str, object]]] = {
    "triangles left out": [(_CULLING, "mesh_array", WholeMesh)],
    "bodies that hide": [
        (module, "hidden", lambda _shells, boxes, *_: np.zeros(boxes.extents_m.shape[1], bool))
        for module in (visible_triangles, visible_edges)
    ],
    "tiles by hulls": [
        (software_path.TileCulling, "target_tiles", lambda _, place: viewport_fit.all_tiles(place.rect))
    ],
    "five samples close up": [(viewport_fit, "NEAR_PIXEL_M", 0.0)],
    "short edges left out": [(visible_edges, "_SHORTEST_PX", 0.0)],
    "depth ranges": [(depth_buffer, "MAX_RANGES", 1)],
    "sorted tiles": [(tiles.SortedTilesPass, "run", EarthTilesPass.run)],
    "smooth tiles": [_changed(_RAYS, "smooth", lambda found, *_: tuple(np.zeros_like(f) for f in found))],
    "fine tiles": [_changed(_RAYS, "smooth", lambda found, *_: (found[0], np.zeros_like(found[1])))],
    "tiles of air": [_changed(_RAYS, "touched", lambda found, *_: (found[0], np.zeros_like(found[1])))],
    "tiles of open sea": [_changed(_RAYS, "waters", lambda found, *_: tuple(np.ones_like(f) for f in found))],
    "tiles of day": [(tiles, "_NIGHT_MU", 9.0)],
    "tiles beside the craft": [
        (tiles, "_covered_tiles", lambda shape, _size, target: np.full(shape, target is not None))
    ],
    "four pixels to a texel": [(smooth_earth, "should_pack", lambda *_: False)],
    "planes over four": [(earth_pass, "MAGNIFIED_LEVEL", -float(_MANY))],
    "air at every other corner": [(frame_air, "_MIN_CORNERS", _MANY)],
    "one level of maps": [
        _changed(
            _EARTH, "_smooth_draw", lambda draw, _self, _earth, _frame, kind: replace(draw, level=kind.level)
        )
    ],
    "stars added at the end": [(StarPass, "may_be_hidden", _all_hidden)],
    "blocks kept": [_changed(_BLOCK, "write", lambda _, block, *__: setattr(block, "_last_values", None))],
    "driver told at once": [(frame_graph, "flush", lambda _context: None)],
}
_NOTHING_SHIPPED = """
from pathlib import Path
from flyaround.simulator.runtime import prebuilt
prebuilt._file = lambda name: Path("/nowhere")
"""
_ALL_DEFINES = """
from flyaround.simulator.render.gl import programs as p
p._head = lambda _, defines: "\\n".join([p.GLSL_VERSION, *(f"#define {k} {v}" for k, v in defines.items()), ""])
"""
_BAKED_FIRST = """
from flyaround.simulator.render.craft.interreflection import Interreflection as I
begin = I.begin
def wait(self, bands):
    if bands not in self._textures and bands not in self._pending:
        begin(self, bands)
        self._pending[bands].result()
I.begin = wait
"""
_NOT_AHEAD = """
from flyaround.simulator.render.frame_passes import FramePasses as P
frame = P.frame
P.frame = lambda self, *, target=True, first=False: frame(self, target=target)
"""
_ONE_STRIP = (
    "from flyaround.simulator.celestial import earth_maps as maps; maps._STRIPS = [slice(0, maps.HEIGHT)]"
)
# executed before any file is read, after the import of all rendering modules
START_WITHOUT = {
    "prebuilt cache": (_NOTHING_SHIPPED, ""),
    "strips": (_ONE_STRIP, ""),
    "compiling ahead": ("", _NOT_AHEAD),
    "defines spoken of": ("", _ALL_DEFINES),
    "light baked beside": ("", _BAKED_FIRST),
}


@contextmanager
def without(name: str) -> Iterator[None]:
    """Disable a shortcut inside the block."""
    with ExitStack() as stack:
        for owner, attribute, value in WITHOUT.get(name, []):
            stack.callback(setattr, owner, attribute, vars(owner)[attribute])
            setattr(owner, attribute, value)
        yield


def least_ms(laps: Sequence[float]) -> float:
    """Return the mean of the smallest third of the times, because other programs disturb the caches."""
    return float(np.sort(laps)[: max(len(laps) // 3, 1)].mean())


def scene_costs(renderers: dict[str, Renderer], scene: str) -> dict[str, tuple[float, int]]:
    """Return the time per frame of a scene [ms] and the maximum difference from the first renderer's image [DN]."""
    plan, views = bench_views(scene, TURNS + WARM_UP)
    laps: dict[str, list[float]] = {name: [] for name in renderers}
    calls_off = dict.fromkeys(renderers, 0)
    order = list(renderers)
    for k, view in enumerate(views):
        images = {}
        for name in order[k % len(order) :] + order[: k % len(order)]:
            with without(name):
                start = time.process_time()
                images[name] = take_frame(renderers[name], view, plan.target, labels=False).image.astype(int)
                if k >= WARM_UP:
                    laps[name].append(1e3 * (time.process_time() - start))
        calls_off = {
            name: max(calls_off[name], int(np.abs(images[name] - images[order[0]]).max())) for name in order
        }
    return {name: (least_ms(laps[name]), calls_off[name]) for name in order}


def frames(names: Sequence[str]) -> None:
    """Print the table of the bench scenes."""
    keep_freed_memory()
    renderers = {}
    for name in ("all", *names):
        with without(name):
            renderers[name] = Renderer()
    costs = [scene_costs(renderers, scene) for scene in SCENES]
    for name in renderers:
        more = [cost[name][0] - (cost["all"][0] if name != "all" else 0.0) for cost in costs]
        cells = " ".join(f"{ms:6.1f}" for ms in more)
        print(f"{name:26s} {cells} | {sum(more):7.1f}, {max(cost[name][1] for cost in costs)} DN", flush=True)


def starts(names: Sequence[str]) -> None:
    """Print the table of a first start: the minimum of several, measured alternately."""
    times: dict[str, list[float]] = {name: [] for name in ("all", *names)}
    for _ in range(STARTS):
        for name, durations in times.items():
            with TemporaryDirectory() as folder:
                durations.append(1e-3 * start_once(folder, *START_WITHOUT.get(name, ("", "")))[0])
    for name, durations in times.items():
        print(f"{name:26s} {min(durations):5.2f} ({min(durations) - min(times['all']):+.2f})")


if __name__ == "__main__":
    chosen = sys.argv[1:]
    if chosen[:1] == ["--start"]:
        starts(chosen[1:] or list(START_WITHOUT))
    else:
        frames(chosen or list(WITHOUT))
