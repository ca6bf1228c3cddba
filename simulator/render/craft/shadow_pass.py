"""Shadow pass: the target seen from Sun and area lights. Reads the mesh; writes shadow maps and their uniforms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.craft.light_maps import LightMaps
from flyaround.simulator.render.craft.mesh_array import shadow_program
from flyaround.simulator.render.craft.placement import TARGET
from flyaround.simulator.render.craft.shadow_frustum import (
    BOX_MARGIN,
    ShadowFrustum,
    fit_shadow_frustum,
    frustum_around,
    light_matrix,
)
from flyaround.simulator.render.frame_graph import Pass, Resource
from flyaround.simulator.render.gl.depth_buffer import DepthBuffer
from flyaround.simulator.render.view import SCENE, VIEW

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.craft.mesh import GpuMesh
    from flyaround.simulator.render.craft.mesh_array import MeshArray
    from flyaround.simulator.render.craft.resident_targets import ResidentTarget
    from flyaround.simulator.render.craft.viewport_fit import ViewportFit
    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.gl.programs import ProgramLibrary
    from flyaround.simulator.render.view import View
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.state import Quality, SceneState


@dataclass(frozen=True)
class ShadowChoice:
    """Resolution and filter of a shadow map.

    Parameters
    ----------
    size_px : int
        Width and height of the map.
    window : int
        Width of the filter's window [texels]; wide penumbrae need many. 0 without sunlight.
    sharpest : float, optional
        Filter radius of the sharpest edges [texels]. With a smaller one the map's texels become visible.
    """

    size_px: int
    window: int
    sharpest: float = 1.0


# the coarse map if its texels are narrower than a pixel; else a finer one, by distance
_COARSE, _FINE, _FINEST = ShadowChoice(512, 4, 0.6), ShadowChoice(1024, 4), ShadowChoice(2048, 4, 1.4)
_BEST = ShadowChoice(2048, 10, 0.6)
_LIMB_MARGIN = 1.3  # margin of the penumbra's width, because limb darkening softens its ends
# widths of a texel [px] above which it is visible at the edge of a shadow, and above which the edge looks stepped
_EDGE_VISIBLE_PX, _STEPS_VISIBLE_PX = 0.9, 2.0
_PENUMBRA_M = (
    3e-3  # radius of the Sun's penumbra 0.6 m behind an edge, which hides the steps of narrower texels
)


def choose_shadow(quality: Quality, box_m: float, pixel_m: float) -> ShadowChoice:
    """Return the resolution for a preset and a view.

    Parameters
    ----------
    quality : Quality
        Quality preset.
    box_m : float
        Width of the box that the map covers.
    pixel_m : float
        Width of an image pixel at the target.
    """
    if quality == "high":
        return _BEST
    texel_px = box_m / _COARSE.size_px / pixel_m
    if quality == "draft" or texel_px < _EDGE_VISIBLE_PX:
        # two thirds of a pixel, but no more than a texel
        return replace(_COARSE, sharpest=min(max(0.65 / texel_px, _COARSE.sharpest), 1.0))
    texel_m = box_m / _FINE.size_px
    return (
        _FINE
        if texel_m < (_STEPS_VISIBLE_PX if texel_m < _PENUMBRA_M else _EDGE_VISIBLE_PX) * pixel_m
        else _FINEST
    )


def widest_penumbra(sun_sine: float) -> float:
    """Return the smallest width of the map, over the height of a blocker, whose filter window holds the penumbra.

    It applies to the preset `high`; the other presets limit penumbrae to three texels.

    Parameters
    ----------
    sun_sine : float
        Sine of the Sun's angular radius.
    """
    reach = _BEST.window / 2 - 0.5
    return _LIMB_MARGIN * sun_sine * _BEST.size_px / reach


class ShadowMap:
    """Orthographic depth map fitted to the target's bounding sphere.

    Parameters
    ----------
    context : Context
        OpenGL context.
    programs : ProgramLibrary
        Programs of this context.
    size_px : int
        Width and height of the map.
    """

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary, size_px: int) -> None:
        self._context = context
        self.size_px = size_px
        self._depth = DepthBuffer(context, (size_px, size_px))
        self.map = self._depth.texture
        self._framebuffer = context.framebuffer(depth_attachment=self.map)
        self._programs = programs

    @property
    def depths(self) -> tuple[float, float]:
        """Depths in the map of the box's near and far side; undrawn texels are farther."""
        return self._depth.range

    @staticmethod
    def light_from_target(mesh: GpuMesh, view: View) -> FloatArray:
        """Return the (4, 4) matrix from the target frame to clip coordinates of a box around its bounding sphere.

        The Sun looks along -z of the box.
        """
        # direction in which the light travels
        light_direction = -(view.R_camera_from_target.T @ view.sun_direction)
        return light_matrix(mesh.center_m, mesh.radius_m, light_direction)

    def run(
        self,
        array: MeshArray,
        view: View,
        light_from_target: FloatArray,
        *,
        clear: bool = False,
    ) -> None:
        """Draw the map. Of closed shells only the sunlit faces are drawn.

        Parameters
        ----------
        array : MeshArray
            Vertex array of the shadow program.
        view : View
            Attitude of the target and direction to the Sun.
        light_from_target : (4, 4) array
            Matrix from `light_from_target`.
        clear : bool, optional
            True to use the first depth range, so that depths of two frames compare.
        """
        # looked up each time, because a mesh's arrays belong to the current lens
        shadow_program(self._programs).set(
            "u_light_clip_from_target", tuple(light_from_target.T.ravel().tolist())
        )
        self._depth.begin(self._framebuffer, clear=clear)
        self._context.enable_only(self._context.DEPTH_TEST)
        to_sun = np.append(view.R_camera_from_target.T @ view.sun_direction, 0.0)
        array.render(to_sun)
        self._depth.end()


@dataclass(frozen=True, eq=False)
class TargetShadow:
    """Shadow maps of one frame, and the settings for reading them.

    Parameters
    ----------
    map : Texture
        Depth map seen from the Sun.
    choice : ShadowChoice
        Its resolution and filter.
    lights : Texture, optional
        Depth maps of the area lights' patches.
    light_points : int, optional
        Number of patches per area light; 0 without area lights.
    """

    map: moderngl.Texture
    choice: ShadowChoice
    lights: moderngl.Texture | None = None
    light_points: int = 0


SHADOW: Resource[TargetShadow] = Resource("shadow map")


class ShadowPass(Pass):
    """Draws the target from the Sun and from area lights, at the resolution that a view needs."""

    name = "target.shadow"
    reads = (SCENE, VIEW, TARGET)
    writes = (SHADOW,)
    submits = True

    def __init__(self, device: Device) -> None:
        self._context, self._programs = device.context, device.programs
        self._block = device.blocks.shadow
        self._lights = LightMaps(device)
        self._maps: dict[int, ShadowMap] = {}

    def release(self) -> None:
        """Free the image of the area lights."""
        self._lights.release()

    def run(self, r: PassResources) -> None:
        """Draw the maps."""
        scene, placed = r[SCENE], r[TARGET]
        sun = self._draw(scene, r[VIEW], placed.resident, placed.fit)
        if scene.area_lights:
            r[SHADOW] = TargetShadow(*sun, *self._lights.draw(scene, placed.resident, placed.fit))
        else:
            r[SHADOW] = TargetShadow(*sun)

    def _map(self, size: int) -> ShadowMap:
        if size not in self._maps:
            self._maps[size] = ShadowMap(self._context, self._programs, size)
        return self._maps[size]

    def _shadow_frustum(
        self,
        resident: ResidentTarget,
        fit: ViewportFit,
        camera: Camera,
        light_from_target: FloatArray,
        widest: float,
    ) -> ShadowFrustum:
        """Return the part of the box that the view needs: the whole craft if the image holds the target."""
        mesh = resident.mesh
        # `high` keeps the sphere's box: its window of texels must hold wide penumbrae
        whole = ShadowFrustum() if widest > 0 else frustum_around(mesh.hull_m, light_from_target)
        inside = [*(fit.bounds_px[:2] >= 0), *(fit.bounds_px[2:] <= [camera.width_px, camera.height_px])]
        # a distorting lens sees beyond the edges of its image's pyramid
        if all(inside) or not camera.distortion.is_none:
            return whole
        part = fit_shadow_frustum(
            resident.patches,
            camera,
            fit.camera_from_target,
            light_from_target,
            closed=mesh.is_closed,
            widest=widest,
        )
        return part if part.half < whole.half else whole

    def _draw(
        self, scene: SceneState, view: View, resident: ResidentTarget, fit: ViewportFit
    ) -> tuple[moderngl.Texture, ShadowChoice]:
        """Draw the shadow map, and return it with its settings. In eclipse the map is not redrawn."""
        camera = scene.camera
        box_m = 2 * resident.mesh.radius_m * BOX_MARGIN
        light_from_target = ShadowMap.light_from_target(resident.mesh, view)
        # by default no penumbra is wider than three texels
        widest = widest_penumbra(view.sun_sine) if scene.quality == "high" else 0.0
        window = self._shadow_frustum(resident, fit, camera, light_from_target, widest)
        light_from_target = window.matrix @ light_from_target
        width_m = box_m * window.half
        choice = choose_shadow(scene.quality, width_m, fit.pixel_m(camera))
        shadow = self._map(choice.size_px)
        texel_m = width_m / shadow.size_px
        if view.sun_visible_fraction > 0:
            # the filter of `high` uses a depth value of its own for "no blocker"
            shadow.run(resident.shadow, view, light_from_target, clear=scene.quality == "high")
        near, far = shadow.depths
        to_texture = np.diag([0.5, 0.5, 0.5 * (far - near), 1.0])
        to_texture[:3, 3] = 0.5, 0.5, 0.5 * (near + far)
        self._block.write(
            {
                "u_light_from_camera": to_texture @ light_from_target @ np.linalg.inv(fit.camera_from_target),
                # a texel in metres and as a depth, its share of the map, and the radius of the sharpest shadow
                "u_shadow": [texel_m, texel_m / box_m * (far - near), 1 / shadow.size_px, choice.sharpest],
                "u_shadow_range": [far - near, 0, 0, 0],
            }
        )
        # without sunlight no shadow is looked up
        return shadow.map, choice if view.sun_share.any() else replace(choice, window=0)
