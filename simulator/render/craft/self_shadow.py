"""Self-shadowing of a target: the frustum and resolution of its shadow map, and the uniforms that read it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.render.craft.shadow_frustum import (
    WIDER,
    ShadowFrustum,
    fit_shadow_frustum,
    frustum_around,
)
from flyaround.simulator.render.craft.shadow_pass import (
    ShadowChoice,
    ShadowPass,
    choose_shadow,
    widest_penumbra,
)

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.craft.resident_targets import ResidentTarget
    from flyaround.simulator.render.craft.viewport_fit import ViewportFit
    from flyaround.simulator.render.gl.programs import ProgramLibrary
    from flyaround.simulator.render.gl.shared_blocks import UniformBlocks
    from flyaround.simulator.render.view import View
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.state import SceneState


class SelfShadow:
    """Draws the map of what of a target the Sun sees, at the size that a view asks for."""

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary, blocks: UniformBlocks) -> None:
        self._context, self._programs, self._blocks = context, programs, blocks
        self._passes: dict[int, ShadowPass] = {}

    @property
    def program(self) -> moderngl.Program:
        """What draws the maps of every size."""
        return self._pass(512).program.gl

    def _pass(self, size: int) -> ShadowPass:
        if size not in self._passes:
            self._passes[size] = ShadowPass(self._context, self._programs, size)
        return self._passes[size]

    def _shadow_frustum(
        self,
        loaded: ResidentTarget,
        place: ViewportFit,
        camera: Camera,
        light_from_target: FloatArray,
        widest: float,
    ) -> ShadowFrustum:
        """What of the box this view's shadow map needs: all that holds the target while the image does."""
        mesh = loaded.mesh
        # `high` keeps the sphere's box: its window of texels must hold wide penumbrae
        whole = ShadowFrustum() if widest > 0 else frustum_around(mesh.hull_m, light_from_target)
        inside = [*(place.bounds_px[:2] >= 0), *(place.bounds_px[2:] <= [camera.width_px, camera.height_px])]
        # a lens that bends sees around the edges of its image's pyramid
        if all(inside) or not camera.distortion.is_none:
            return whole
        part = fit_shadow_frustum(
            loaded.patches,
            camera,
            place.camera_from_target,
            light_from_target,
            closed=mesh.is_closed,
            widest=widest,
        )
        return part if part.half < whole.half else whole

    def draw(
        self, scene: SceneState, view: View, loaded: ResidentTarget, place: ViewportFit
    ) -> tuple[moderngl.Texture, ShadowChoice]:
        """Draw the shadow map and say what the shading needs to know of it; the map in shade is an old one."""
        camera = scene.camera
        box_m = 2 * loaded.mesh.radius_m * WIDER
        light_from_target = ShadowPass.light_from_target(loaded.mesh, view)
        # by default no penumbra is wider than three texels
        widest = widest_penumbra(view.sun_sine) if scene.quality == "high" else 0.0
        window = self._shadow_frustum(loaded, place, camera, light_from_target, widest)
        light_from_target = window.matrix @ light_from_target
        width_m = box_m * window.half
        choice = choose_shadow(scene.quality, width_m, place.pixel_m(camera))
        shadow = self._pass(choice.size_px)
        texel_m = width_m / shadow.size_px
        if view.sun_visible_fraction > 0:
            # the filter of `high` has depths of its own that it takes for none
            shadow.run(loaded.shadow, view, light_from_target, clear=scene.quality == "high")
        near, far = shadow.depths
        half = np.diag([0.5, 0.5, 0.5 * (far - near), 1.0])
        half[:3, 3] = 0.5, 0.5, 0.5 * (near + far)
        self._blocks.shadow.write(
            {
                "u_light_from_camera": half @ light_from_target @ np.linalg.inv(place.camera_from_target),
                # a texel in metres and as a depth, its share of the map, and the radius of the sharpest shadow
                "u_shadow": [texel_m, texel_m / box_m * (far - near), 1 / shadow.size_px, choice.sharpest],
                "u_shadow_range": [far - near, 0, 0, 0],
            }
        )
        # without sunlight nothing is to be looked up
        return shadow.map, choice if view.sun_share.any() else replace(choice, window=0)
