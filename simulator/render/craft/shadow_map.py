"""Shadow map: depth of the target seen from the Sun, and the resolution that a view asks for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.craft.mesh_array import shadow_program
from flyaround.simulator.render.craft.shadow_frustum import light_matrix
from flyaround.simulator.render.gl.depth_buffer import DepthBuffer

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.render.craft.mesh_array import MeshArray
    from flyaround.simulator.render.gl.programs import ProgramLibrary
    from flyaround.simulator.render.view import View
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.state import Quality


@dataclass(frozen=True)
class ShadowChoice:
    """Resolution of the map, the window of texels that a point looks at (wide penumbrae need many; 0 without sunlight),
    and the radius of the sharpest edge [texels]: below one, the map's own steps show.
    """

    size_px: int
    window: int
    sharpest: float = 1.0


# the coarse map where its texel is less than a pixel wide, else a fine one, close up a finer
_COARSE, _FINE, _FINER = ShadowChoice(512, 4, 0.6), ShadowChoice(1024, 4), ShadowChoice(2048, 4, 1.4)
_BEST = ShadowChoice(2048, 10, 0.6)
_SLACK = 1.3  # for the softness of the disc's own edge
_PIXEL, _SAWN = 0.9, 2.0  # pixels: wider texels leave their mark on shadows' edges; on all of them, as steps
_PENUMBRA_M = 3e-3  # radius of the Sun's penumbra 0.6 m behind an edge; it hides the steps of texels no wider


def choose_shadow(quality: Quality, box_m: float, pixel_m: float) -> ShadowChoice:
    """Resolution for a preset and a view.

    Parameters
    ----------
    box_m : width of the box that the map covers. pixel_m : width of an image pixel on the target.
    """
    if quality == "high":
        return _BEST
    texel_px = box_m / _COARSE.size_px / pixel_m
    if quality == "draft" or texel_px < _PIXEL:
        # two thirds of a pixel, while that is no more than a texel
        return replace(_COARSE, sharpest=min(max(0.65 / texel_px, _COARSE.sharpest), 1.0))
    texel_m = box_m / _FINE.size_px
    return _FINE if texel_m < (_SAWN if texel_m < _PENUMBRA_M else _PIXEL) * pixel_m else _FINER


def widest_penumbra(sun_sine: float) -> float:
    """Width of the map over the height of a blocker whose penumbra fills the window of the preset `high`.

    Parameters
    ----------
    sun_sine : of the Sun's angular radius.
    """
    reach = _BEST.window / 2 - 0.5
    return _SLACK * sun_sine * _BEST.size_px / reach


class ShadowMap:
    """Orthographic depth map fitted to the target's bounding sphere.

    Parameters
    ----------
    size_px : width and height of the map.
    """

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary, size_px: int) -> None:
        self._context = context
        self.size_px = size_px
        self._depth = DepthBuffer(context, (size_px, size_px))
        self.map = self._depth.texture
        self._framebuffer = context.framebuffer(depth_attachment=self.map)
        self._program = shadow_program(programs)

    @property
    def depths(self) -> tuple[float, float]:
        """Depths in the map of the box's side to the Sun and of the other; texels that were not drawn are farther."""
        return self._depth.range

    @staticmethod
    def light_from_target(mesh: GpuMesh, view: View) -> FloatArray:
        """(4, 4) clip matrix from the target frame: the Sun looks along -z of a box around the sphere."""
        along = -(view.R_camera_from_target.T @ view.sun_direction)  # direction of travel of the light
        return light_matrix(mesh.center_m, mesh.radius_m, along)

    def run(
        self,
        array: MeshArray,
        view: View,
        light_from_target: FloatArray,
        *,
        clear: bool = False,
    ) -> None:
        """Draw the map: of closed shells the lit sides, which are nearest to the Sun.

        Parameters
        ----------
        light_from_target : (4, 4) as `light_from_target` gives it.
        clear : have depths of the first range, so that those of two frames compare.
        """
        self._program.set("u_light_clip_from_target", tuple(light_from_target.T.ravel().tolist()))
        self._depth.begin(self._framebuffer, clear=clear)
        self._context.enable_only(self._context.DEPTH_TEST)
        to_sun = np.append(view.R_camera_from_target.T @ view.sun_direction, 0.0)
        array.render(to_sun)
        self._depth.end()
