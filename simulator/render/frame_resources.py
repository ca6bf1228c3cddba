"""What the passes of a frame hand on to each other, by name and type."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.render.frame_graph import Resource

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.craft.interreflection import AtlasTextures
    from flyaround.simulator.render.craft.target_passes import PlacedTarget, TargetSamples, TargetShadow
    from flyaround.simulator.render.earth.earth_pass import EarthPass
    from flyaround.simulator.render.earth.screen_tiles import ScreenTiles
    from flyaround.simulator.render.frame_images import FrameImages
    from flyaround.simulator.render.globe.globe_pass import GlobePass
    from flyaround.simulator.render.globe.globe_view import GlobeView
    from flyaround.simulator.render.moon.moon_view import MoonView
    from flyaround.simulator.render.sky.star_pass import Spread
    from flyaround.simulator.render.view import View
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray
    from flyaround.simulator.scene.illumination.atmosphere import Atmosphere
    from flyaround.simulator.scene.illumination.irradiance import IrradianceField
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

SCENE: Resource[SceneState] = Resource("scene")
MODEL: Resource[Target] = Resource("target model")
VIEW: Resource[View] = Resource("view")
"""The scene in the camera's coordinates; the light of Earth and Moon on the target comes into it last."""

GIVEN_IRRADIANCE: Resource[IrradianceField] = Resource("given irradiance")
"""Light on the target in place of that of Earth and Moon, for proofs."""

RADIANCE: Resource[FrameImages] = Resource("radiance")
COVERAGE: Resource[FrameImages] = Resource("coverage")
"""Two of the frame's images: the target is drawn into both, the sky is added to the first by what the second leaves."""

TARGET: Resource[PlacedTarget] = Resource("target")
TARGET_TILES: Resource[FloatArray] = Resource("target tiles")
"""(K, 2) centres of the tiles to be shaded pixel by pixel."""
SAMPLES: Resource[TargetSamples] = Resource("samples")
SHADOW: Resource[TargetShadow] = Resource("shadow map")
EDGE_SLOPES: Resource[moderngl.Texture] = Resource("edge slopes")
TARGET_LIGHT: Resource[AtlasTextures] = Resource("target light")
"""Light that the target's parts give each other, on the atlas of its charts."""

MOON: Resource[MoonView] = Resource("moon")
EARTH_PASS: Resource[EarthPass] = Resource("earth pass")
"""The Earth's maps on the GPU, and what draws them."""
GLOBE_PASS: Resource[GlobePass] = Resource("globe pass")
"""What draws another body in the Earth's place."""
GLOBE: Resource[GlobeView] = Resource("globe")
"""The body that is ray-cast, in the image; it hides what is behind it."""
AIR: Resource[Atmosphere] = Resource("air")
AIR_TABLES: Resource[list[moderngl.Texture]] = Resource("air tables")
EARTH_TILES: Resource[ScreenTiles] = Resource("earth tiles")

STARLIGHT: Resource[Spread] = Resource("starlight")
"""Light of points that is added to the picture when it is read."""
PICTURE: Resource[Float32Array] = Resource("picture")
