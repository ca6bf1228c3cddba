"""The uniform blocks that passes share: names, binding points, members and their units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from flyaround.simulator.render.gl.uniform_block import Field, UniformBlock
from flyaround.simulator.scene.illumination.area_light import MAX_LIGHTS

if TYPE_CHECKING:
    import moderngl

MAX_PATCHES = 128
"""Largest number of patches of all area lights together; see simulator/render/craft/light_maps.py."""
MAX_MATERIALS = 255
"""Largest number of materials: the G-buffer stores the index in 8 bits, 0 for none."""

FRAME = (
    Field("vec4", "u_intrinsics"),  # fx, fy, cx, cy [px]
    Field(
        "vec4", "u_sun_direction"
    ),  # xyz: from the target, camera frame; w: sine of the Sun's angular radius
    Field("vec4", "u_sun_irradiance"),  # per band at normal incidence, eclipse included [W m-2]
    Field("vec4", "u_sky", 10),  # irradiance by normal, camera frame, per band [W m-2]; see skylight.py
    Field("vec4", "u_globe_radiance", 3),  # one per band: gradient and constant over directions [W m-2 sr-1]
    Field("vec4", "u_globe_rim"),  # xyz: towards the disc's centre, camera frame; w: cosine of its radius
    Field(
        "vec4", "u_nadir_direction"
    ),  # xyz: towards the Earth's centre; w: share of the sky's light from there, 0..1
    Field("vec4", "u_lamp_place"),  # xyz: position of the chaser's lamp, camera frame [m]; w: beam profile
    Field("vec4", "u_lamp_intensity"),  # on its axis, per band [W sr-1]
)

# a distorting lens
LENS = (
    Field("vec4", "u_lens_k"),  # k1 k2 k3 k4
    Field("vec4", "u_lens_m"),  # k5 k6 p1 p2
    Field("vec4", "u_lens_limits"),  # undistorted radius of use; 1 Brown-Conrady, 2 Kannala-Brandt
)

TARGET = (
    Field("mat4", "u_pattern_clip"),  # from the target; with a lens, from the distorted space of lens.glsl
    Field("mat4", "u_camera_from_target"),
    Field("vec4", "u_pattern"),  # s0, t0; near, far [m]
    Field("vec4", "u_pattern_px"),  # xy: size of the lattice's viewport [samples]
)

# computed while the samples are drawn, which do not need it
SHADOW = (
    Field("mat4", "u_light_from_camera"),  # to shadow-map texture coordinates, 0..1, and depth
    # texel [m], the same as a depth, 1 / size, radius of the sharpest edge's filter [texels]
    Field("vec4", "u_shadow"),
    Field("vec4", "u_shadow_range"),  # depth of the box in the map's own depths (float_depth.py)
)

# "Globe" space: the body's axes in equatorial radii, the polar axis stretched so that the ellipsoid is a unit sphere
GLOBE = (
    Field("mat4", "u_globe_from_camera"),
    Field("vec4", "u_globe_camera"),  # position [equatorial radii]; w: one over its length
    Field("vec4", "u_globe_sun"),  # unit vector; w: its cosine with the camera's zenith
    Field("vec4", "u_globe_moon"),  # unit vector; w: its irradiance over the Sun's
    Field("vec4", "u_globe_irradiance"),  # Sun's, above the air, per band [W m-2]
    Field("vec4", "u_globe_limits"),  # sine of the Sun's angle from the zenith; top of the air^2; a / b; 0
    Field(
        "vec4", "u_globe_meridian"
    ),  # unit vector of the camera's longitude in the equatorial plane; its longitude [rad]
    Field("vec4", "u_air_radius"),  # ground, top, camera [m]; angular radius of the Sun [rad]
    Field("vec4", "u_air_sun"),  # cosine of the Sun's angle from the camera's zenith
    # lower edge of the airglow [m]; one over the aerosol's scale height [m-1]; asymmetry g; upper edge
    Field("vec4", "u_air_shape"),
    Field("vec4", "u_air_layers", 3),  # layers of the density: lowest heights [m]
    Field("vec4", "u_air_falls", 3),  # increase of the density's logarithmic slope from there on [m-1]
    Field("vec4", "u_airglow"),  # at the zenith over the Sun's irradiance, per band [sr-1]
    Field("vec4", "u_air_rayleigh"),  # scattering coefficient per band, at sea level [m-1]
    Field("vec4", "u_air_mie_scattering"),
    Field("vec4", "u_air_mie_extinction"),
    Field("vec4", "u_air_ozone"),
)

# "Moon" space: the Moon's axes (mean Earth, polar axis), in its radii
MOON = (
    Field("mat4", "u_moon_from_camera"),
    Field("vec4", "u_moon_camera"),  # position
    Field("vec4", "u_moon_sun"),  # unit vector
    Field("vec4", "u_moon_earth"),  # unit vector; w: Earth's irradiance over the Sun's
    Field(
        "vec4", "u_moon_meridian"
    ),  # unit vector of the camera's longitude in the equatorial plane; its longitude [rad]
    Field("vec4", "u_moon_albedo"),  # geometric albedo, per band
    Field("vec4", "u_moon_irradiance"),  # Sun's, per band [W m-2]
    Field("vec4", "u_moon_shadow"),  # from the Earth to the Moon; w: reach of the table across Earth's shadow
    Field("vec4", "u_moon_shadow_axis"),  # unit vector along the shadow
)

MATERIALS = (
    Field("vec4", "u_material_color", MAX_MATERIALS + 1),  # reflectance per band; w: metallic
    # roughness, clear coat (plus one: with films), its roughness, creases (negative: mottle)
    Field("vec4", "u_material_surface", MAX_MATERIALS + 1),
    Field(
        "vec4", "u_material_grain", MAX_MATERIALS + 1
    ),  # xyz: direction of brushing, target frame; w: strength, negative: around it
)

# simulator/render/craft/light_maps.py; lights are rectangles, each divided into equal patches
AREA_LIGHTS = (
    Field(
        "vec4", "u_light_count"
    ),  # number of lights; offset of a point from its face [m at 1 m]: grazing, always
    Field("vec4", "u_light_middle", MAX_LIGHTS),  # centre, camera frame [m]
    Field("vec4", "u_light_right", MAX_LIGHTS),  # half a side [m]; w: area of a patch [m2]
    Field("vec4", "u_light_down", MAX_LIGHTS),  # half the other side [m]
    Field("vec4", "u_light_axis", MAX_LIGHTS),  # unit vector; w: exponent of the cosine from it
    Field("vec4", "u_light_radiance", MAX_LIGHTS),  # on the axis, per band [W m-2 sr-1]
    Field("vec4", "u_patch_place", MAX_PATCHES),  # camera frame [m]
    Field("mat4", "u_patch_map", MAX_PATCHES),  # from the camera frame to texture coordinates and depth
)


@dataclass(frozen=True, eq=False)
class UniformBlocks:
    """All uniform blocks of one renderer."""

    frame: UniformBlock
    target: UniformBlock
    materials: UniformBlock
    globe: UniformBlock
    moon: UniformBlock
    lens: UniformBlock
    shadow: UniformBlock
    lights: UniformBlock

    @staticmethod
    def create(context: moderngl.Context) -> UniformBlocks:
        """Allocate the blocks."""
        return UniformBlocks(
            UniformBlock(context, "Frame", 0, FRAME),
            UniformBlock(context, "TargetTransforms", 1, TARGET),
            UniformBlock(context, "Materials", 2, MATERIALS),
            UniformBlock(context, "Globe", 3, GLOBE),
            UniformBlock(context, "Moon", 4, MOON),
            UniformBlock(context, "Lens", 5, LENS),
            UniformBlock(context, "Shadow", 6, SHADOW),
            UniformBlock(context, "AreaLights", 7, AREA_LIGHTS),
        )

    def all(self) -> tuple[UniformBlock, ...]:
        """Return the blocks in order of their binding."""
        return (
            self.frame,
            self.target,
            self.materials,
            self.globe,
            self.moon,
            self.lens,
            self.shadow,
            self.lights,
        )
