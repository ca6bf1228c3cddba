"""Shadow maps of area lights.

Each light is divided into patches, and each patch has a shadow map. All maps are tiles of one image.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.directions import orthonormal_basis
from flyaround.simulator.render.craft.mesh_array import shadow_program
from flyaround.simulator.render.gl.fences import draw_to
from flyaround.simulator.render.gl.shared_blocks import MAX_PATCHES
from flyaround.simulator.render.gl.uniform_block import vec4_of_bands
from flyaround.simulator.scene.illumination.area_light import MAX_LIGHTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    import moderngl

    from flyaround.simulator.render.craft.resident_targets import ResidentTarget
    from flyaround.simulator.render.craft.viewport_fit import ViewportFit
    from flyaround.simulator.render.device import Device
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.area_light import CameraFrameLight
    from flyaround.simulator.scene.state import Quality, SceneState

PATCHES: dict[Quality, int] = {"draft": 4, "default": 8, "high": 16}
"""Patches per light. The penumbra of a straight edge has that many steps, each weaker than the image's noise."""
TILE_PX = 512
"""Side of one patch's map."""
_SPHERE_MARGIN = 1.03  # radius of the map's view over that of the craft, for the filter's reach
_MIN_NEAR_SHARE = (
    0.02  # nearest depth over the distance, for a patch inside the sphere: 24 bits of depth still suffice
)
_MAX_HALF_ANGLE_SINE = 0.9  # of a map's field of view; the map of a nearer light shows only part of the craft
_GRAZING_OFFSET_TEXELS, _MIN_OFFSET_TEXELS = 1.5, 0.15
"""Offset of a shaded point from its face against self-shadowing [texels]: at grazing incidence, and at normal."""


def patch_view(patch_m: FloatArray, center_m: FloatArray, radius_m: float) -> tuple[FloatArray, float]:
    """Return the (4, 4) clip matrix of a patch's view of a sphere, and the angle of a texel [rad].

    Depth grows away from the light, from -1 to 1.

    Parameters
    ----------
    patch_m : (3,) array
        Centre of the patch [m].
    center_m : (3,) array
        Centre of the sphere around the craft [m].
    radius_m : float
        Radius of the sphere [m].
    """
    to_center = center_m - patch_m
    distance = max(float(np.linalg.norm(to_center)), 1e-3)
    sine = min(_SPHERE_MARGIN * radius_m / distance, _MAX_HALF_ANGLE_SINE)
    tangent = sine / math.sqrt(1 - sine * sine)
    near = max(distance - _SPHERE_MARGIN * radius_m, _MIN_NEAR_SHARE * distance)
    far = distance + _SPHERE_MARGIN * radius_m
    view = np.eye(4)
    view[:3, :3] = orthonormal_basis(to_center / distance)
    view[:3, 3] = -view[:3, :3] @ patch_m
    clip = np.zeros((4, 4))
    clip[0, 0] = clip[1, 1] = 1 / tangent
    clip[2, 2:] = (far + near) / (far - near), -2 * far * near / (far - near)
    clip[3, 2] = 1.0
    return clip @ view, 2 * tangent / TILE_PX


class LightMaps:
    """Shadow maps of one frame's area lights."""

    def __init__(self, device: Device) -> None:
        self._context, self._block = device.context, device.blocks.lights
        self._programs = device.programs
        self._image: moderngl.Texture | None = None
        self._framebuffer: moderngl.Framebuffer | None = None

    def draw(
        self, scene: SceneState, resident: ResidentTarget, fit: ViewportFit
    ) -> tuple[moderngl.Texture, int]:
        """Draw the maps and write the uniform block.

        Returns
        -------
        tuple
            Image of all maps, and number of patches per light.
        """
        mesh, count = resident.mesh, PATCHES[scene.quality]
        lights = [light.in_camera_frame(scene.camera_from_target) for light in scene.area_lights]
        target_from_camera = np.linalg.inv(fit.camera_from_target)
        patches = [point for light in lights for point in light.points_m(count)]
        columns = math.ceil(math.sqrt(len(patches)))
        image, framebuffer = self._images(columns * TILE_PX)
        draw_to(framebuffer)
        framebuffer.viewport = (0, 0, *image.size)
        framebuffer.clear()
        self._context.enable_only(self._context.DEPTH_TEST)
        program = shadow_program(self._programs)
        matrices, texel_rad = np.zeros((MAX_PATCHES, 4, 4)), 0.0
        for k, patch in enumerate(patches):
            row, column = divmod(k, columns)
            point = target_from_camera[:3, :3] @ patch + target_from_camera[:3, 3]
            clip, texel = patch_view(point, mesh.center_m, mesh.radius_m)
            texel_rad = max(texel_rad, texel)
            framebuffer.viewport = (column * TILE_PX, row * TILE_PX, TILE_PX, TILE_PX)
            program.set("u_light_clip_from_target", tuple(clip.T.ravel().tolist()))
            resident.shadow.render(np.append(point, 1.0))
            tile = np.eye(4)
            tile[:3, :3] = np.diag([0.5 / columns, 0.5 / columns, 0.5])
            tile[:3, 3] = (column + 0.5) / columns, (row + 0.5) / columns, 0.5
            matrices[k] = tile @ clip @ target_from_camera
        self._block.write(_values(scene, lights, patches, matrices, texel_rad))
        return image, count

    def _images(self, side: int) -> tuple[moderngl.Texture, moderngl.Framebuffer]:
        if self._image is None or self._framebuffer is None or self._image.width != side:
            self.release()
            self._image = self._context.depth_texture((side, side))
            self._image.compare_func = "<="
            self._image.filter = (self._context.LINEAR, self._context.LINEAR)
            self._image.repeat_x = self._image.repeat_y = False
            self._framebuffer = self._context.framebuffer(depth_attachment=self._image)
        return self._image, self._framebuffer

    def release(self) -> None:
        """Free the image."""
        if self._image is not None and self._framebuffer is not None:
            self._framebuffer.release()
            self._image.release()
        self._image = self._framebuffer = None


def _values(
    scene: SceneState,
    lights: Sequence[CameraFrameLight],
    patches: Sequence[FloatArray],
    matrices: FloatArray,
    texel_rad: float,
) -> dict[str, FloatArray]:
    """Return the members of the block ``AreaLights``."""
    names = ("middle", "right", "down", "axis", "radiance")
    values = {f"u_light_{name}": np.zeros((MAX_LIGHTS, 4)) for name in names}
    area_share = len(lights) / len(patches)
    for k, (light, spec) in enumerate(zip(lights, scene.area_lights, strict=True)):
        values["u_light_middle"][k, :3] = light.middle_m
        values["u_light_right"][k] = [*light.right_m, light.area_m2 * area_share]
        values["u_light_down"][k, :3] = light.down_m
        values["u_light_axis"][k] = [*light.axis, light.exponent]
        values["u_light_radiance"][k] = vec4_of_bands(spec.radiance(scene.bands))
    positions = np.zeros((MAX_PATCHES, 4))
    positions[: len(patches), :3] = patches
    # offset of a point [m] at one metre from the light, by texels
    count = np.array([len(lights), _GRAZING_OFFSET_TEXELS * texel_rad, _MIN_OFFSET_TEXELS * texel_rad, 0.0])
    return {**values, "u_patch_place": positions, "u_patch_map": matrices, "u_light_count": count}
