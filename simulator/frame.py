"""One frame: scene -> radiance -> detector -> image, with its truth from the same instant."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.imaging.exposure import integrate
from flyaround.simulator.imaging.image_formation import digitise_scene, expose_scene, prefetch_scene_noise
from flyaround.simulator.labels.labelling import label_picture
from flyaround.simulator.labels.request import LabelRequest
from flyaround.simulator.scene.limits import imaging_problem

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.labels.truth import Truth
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

# Placeholders for the arrays of a frame that were dropped.
NO_RADIANCE, _NO_IMAGE = np.zeros((0, 0), np.float32), np.zeros((0, 0), np.uint8)


@dataclass(frozen=True, eq=False)
class Frame:
    """A rendered image with its ground truth.

    Parameters
    ----------
    scene : SceneState
        The snapshot that was drawn.
    image : (H, W) or (H, W, 3) array
        Digital numbers, RGB order.
    radiance : array
        Linear band radiance before the detector [W m-2 sr-1].
    truth : Truth, optional
        The label record, or None if no labels were requested.
    mask : (H, W) uint8 array, optional
        255 on the target, or None.
    depth_m : (H, W) array, optional
        Camera z, NaN outside, or None.
    layers : dict, optional
        The label images that were requested, by name.
    stage_ms : dict, optional
        Wall time of each stage: the frame's ledger.
    faults : tuple of str, optional
        Camera faults injected into the image.
    time_code_px : tuple of int, optional
        Columns and rows (half-open) of a time code drawn into the image, or None.
    camera_frame : int, optional
        The camera's own frame counter, if it differs from the frame's number.
    """

    scene: SceneState
    image: NDArray[np.unsignedinteger]
    radiance: Float32Array
    truth: Truth | None = None
    mask: ByteArray | None = None
    depth_m: Float32Array | None = None
    layers: dict[str, NDArray[Any]] = field(default_factory=dict)
    stage_ms: dict[str, float] = field(default_factory=dict)
    faults: tuple[str, ...] = ()
    time_code_px: tuple[int, int, int, int] | None = None
    camera_frame: int | None = None

    @property
    def number(self) -> int:
        """The frame's number in its plan."""
        return self.scene.frame_index

    @property
    def render_ms(self) -> float:
        """Time of drawing the image, without labels [ms]."""
        return self.stage_ms.get("render", 0.0) + self.stage_ms.get("sensor", 0.0)

    def without_radiance(self) -> Frame:
        """Return the frame without radiance and depth, for a window.

        Returns
        -------
        Frame
            Copy; arrays that it keeps are shared.
        """
        return replace(self, radiance=NO_RADIANCE, depth_m=None)

    def image_and_truth(self) -> Frame:
        """Return the frame without radiance, mask and layers, for a board.

        Returns
        -------
        Frame
            Copy; the image is shared.
        """
        return replace(self, radiance=NO_RADIANCE, depth_m=None, mask=None, layers={})

    def without_image(self) -> Frame:
        """Return the frame without pixels: scene, truth and ledger.

        Returns
        -------
        Frame
            Copy with an empty image.
        """
        return replace(self.image_and_truth(), image=_NO_IMAGE)


def take_frame(
    renderer: Renderer, scene: SceneState, target: Target, *, labels: bool | LabelRequest = True
) -> Frame:
    """Draw, expose, digitise and label one scene. A pure function of the scene, the target and the request.

    Parameters
    ----------
    renderer : Renderer
        Renderer of the images.
    scene : SceneState
        Scene at mid-exposure.
    target : Target
        Model of the scene's craft, before any variation.
    labels : bool or LabelRequest, optional
        True for truth and mask, or a request for further layers.

    Returns
    -------
    Frame
        Image [DN], radiance [W m-2 sr-1], and the requested labels.

    Raises
    ------
    UserError
        If a number of the lens, optics or sensor is out of range, or does not fit the others.
    """
    problem = imaging_problem(scene)
    if problem is not None:
        raise UserError(f"the scene cannot be drawn: {problem}")
    target = scene.target.drawn(target)
    start = time.perf_counter()
    noise = prefetch_scene_noise(scene)
    exposed = integrate(renderer, scene, target)
    drawn_s = time.perf_counter()
    signal = expose_scene(scene, exposed.radiance)
    image = digitise_scene(scene, signal, noise=noise)
    formed_s = time.perf_counter()
    stage_ms = {"render": (drawn_s - start) * 1e3, "sensor": (formed_s - drawn_s) * 1e3}
    stage_ms.update({f"render.{name}": ms for name, ms in exposed.stage_ms.items()})
    if not labels:
        return Frame(scene, image, exposed.radiance, stage_ms=stage_ms)
    request = labels if isinstance(labels, LabelRequest) else LabelRequest()
    result = label_picture(renderer, scene, target, request, signal, image)
    stage_ms["labels"] = (time.perf_counter() - formed_s) * 1e3
    return Frame(
        scene,
        image,
        exposed.radiance,
        result.truth,
        result.mask,
        result.depth_m,
        result.layers,
        stage_ms,
    )
