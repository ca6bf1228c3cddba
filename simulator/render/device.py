"""One OpenGL context and the state that all passes share: uniform blocks, programs, lens rays and frame images."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.render.frame_images import FrameImages
from flyaround.simulator.render.gl.context import create_context, describe
from flyaround.simulator.render.gl.fences import keep_fences
from flyaround.simulator.render.gl.lens_rays import RayTextures
from flyaround.simulator.render.gl.programs import RAYS_UNIT, ProgramLibrary
from flyaround.simulator.render.gl.shared_blocks import UniformBlocks
from flyaround.simulator.scene.illumination.atmosphere import OZONE_HALF_WIDTH_M, OZONE_HEIGHT_M
from flyaround.simulator.scene.illumination.bands import bands_of
from flyaround.simulator.scene.illumination.lamp import FLAT_EDGE
from flyaround.simulator.scene.illumination.refraction import LIMB_DARKENING
from flyaround.simulator.world.constants import EARTH_RADIUS_M, MOON_RADIUS_M

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.gl.context import GlInfo
    from flyaround.simulator.scene.state import SceneState


PHYSICAL_CONSTANTS = {
    "EARTH_KM": EARTH_RADIUS_M / 1e3,
    "MOON_KM": MOON_RADIUS_M / 1e3,
    "OZONE_HEIGHT_M": OZONE_HEIGHT_M,
    "OZONE_HALF_WIDTH_M": OZONE_HALF_WIDTH_M,
    "LIMB_DARKENING": LIMB_DARKENING,
    "FLAT_EDGE": FLAT_EDGE,
}
"""Constants shared by shaders and their CPU twins, as preprocessor definitions."""


class Device:
    """The driver and the state that belongs to no single pass.

    Parameters
    ----------
    device_index : int, optional
        EGL device; see `flyaround.simulator.render.renderer.Renderer`.
    context : Context, optional
        Existing context to use instead of a new one.
    """

    def __init__(self, device_index: int | None = None, context: moderngl.Context | None = None) -> None:
        self._owns_context = context is None
        self.context = create_context(device_index) if context is None else context
        self.info: GlInfo = describe(self.context)
        if self.info.is_software:
            keep_fences(self.context)
        self.blocks = UniformBlocks.create(self.context)
        flat = {"FLAT_INPUTS": 1.0} if self.info.is_software else {}
        self.programs = ProgramLibrary(self.context, self.blocks.all(), PHYSICAL_CONSTANTS | flat)
        self._rays = RayTextures(self.context)
        self._images: FrameImages | None = None

    def make_current(self) -> None:
        """Make the context current in this thread, unless the caller supplied it.

        Another context may have been created since the last call.
        """
        if self._owns_context:
            self.context.__enter__()  # type: ignore[no-untyped-call]

    def check(self, operation: str) -> None:
        """Raise if OpenGL recorded an error during an operation; moderngl ignores most errors.

        Parameters
        ----------
        operation : str
            What was done since the last check, for the message.

        Raises
        ------
        MemoryError
            If OpenGL is out of memory.
        RuntimeError
            If OpenGL reports any other error.
        """
        error = self.context.error
        if error == "GL_OUT_OF_MEMORY":
            raise MemoryError(f"OpenGL, after {operation} on {self.info.renderer}")
        if error != "GL_NO_ERROR":
            raise RuntimeError(f"OpenGL reports {error} after {operation} on {self.info.renderer}")

    def prepare(self, scene: SceneState) -> None:
        """Bind the resources that every pass reads, and choose programs for the scene's lens."""
        self.make_current()
        for block in self.blocks.all():
            block.bind()
        self.programs.lens = not scene.camera.distortion.is_none
        if self.programs.lens:
            self._rays.get(scene.camera).use(RAYS_UNIT)

    def images_for(self, scene: SceneState) -> FrameImages:
        """Return the images of a scene's size and bands; they still hold the last frame."""
        size, bands = (scene.camera.width_px, scene.camera.height_px), len(bands_of(scene.bands))
        if self._images is None or (self._images.size, self._images.bands) != (size, bands):
            if self._images is not None:
                self._images.release()
            self._images = FrameImages(self.context, *size, bands)
            self.check(f"allocating images of {size[0]} x {size[1]}")
        return self._images

    def close(self) -> None:
        """Free images and rays, and the context if it is this device's own."""
        if self._images is not None:
            self._images.release()
            self._images = None
        self._rays.release()
        if self._owns_context:
            # EGL keeps a context and all its textures while it is a thread's current one
            self.context.__exit__(None, None, None)  # type: ignore[no-untyped-call]
            self.context.release()
