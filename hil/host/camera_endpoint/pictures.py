"""Images that the endpoint sends: rendered when due, or rendered in advance and looped."""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import Frame
from flyaround.simulator.loop import FrameRequest, open_frames, run_frames
from flyaround.simulator.runtime.worker_pool import JobsLostError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from flyaround.hil.host.camera_endpoint.messages import ImageRequest
    from flyaround.simulator.loop import FrameProducer
    from flyaround.simulator.scenario.plan import Plan
    from flyaround.simulator.scene.state import SceneState

    Image = NDArray[np.unsignedinteger]


# Largest number of warm-up images before the camera becomes discoverable, and their time-out [s]. More find more of the
# shaders that the flight will need, and delay the start.
WARM_UP_PICTURES, WARM_UP_S = 16, 15.0


@dataclass(frozen=True)
class CapturedImage:
    """Image with the scene that it shows.

    Parameters
    ----------
    image : (H, W) array
        Digital numbers of the whole detector.
    scene : SceneState, optional
        Scene; None if unknown.
    """

    image: Image
    scene: SceneState | None = None


class Pictures(Protocol):
    """Source of images for the endpoint."""

    def take(self, request: ImageRequest) -> CapturedImage | None:
        """Return the requested image; None if it is lost."""


class RenderedPictures:
    """Images rendered when due, from the flight's state at that time. The flight restarts when it ends.

    Parameters
    ----------
    plan : Plan
        Frames of a scenario.
    producer : FrameProducer
        Renders one image at a time.
    """

    def __init__(self, plan: Plan, producer: FrameProducer[Image]) -> None:
        self._plan, self._producer = plan, producer

    def warm_up(self) -> None:
        """Render moments of the whole flight as warm-up, because the first image of a kind takes seconds."""
        until_s = time.monotonic() + WARM_UP_S
        for t_s in np.linspace(0.0, self._plan.scenario.duration_s, WARM_UP_PICTURES, endpoint=False):
            if time.monotonic() > until_s:
                return
            scene = self._plan.scene_of(self._plan.flight.state(float(t_s)), 0)
            with contextlib.suppress(JobsLostError):
                self._producer.submit(FrameRequest(scene=scene, labels=False))
                self._producer.result()

    def take(self, request: ImageRequest) -> CapturedImage | None:
        """Render an image with the exposure and gain set by the controller.

        Returns
        -------
        CapturedImage or None
            Image with its scene at ``request.t_s``, modulo the flight's duration; None if rendering was lost.
        """
        t_s = request.t_s % self._plan.scenario.duration_s
        scene = with_exposure(self._plan.scene_of(self._plan.flight.state(t_s), request.number), request)
        try:
            self._producer.submit(FrameRequest(scene=scene, labels=False))
            return CapturedImage(self._producer.result(), scene)
        except JobsLostError:
            return None


class LoopedPictures:
    """Looped images. Exposure and gain scale their values, and clipped pixels stay clipped.

    Parameters
    ----------
    images : sequence of (H, W) array
        Images.
    bits : int
        Bits per pixel.
    exposure_s : float
        Exposure time of images without a scene.
    black_dn : float, optional
        Pixel value without light.
    scenes : sequence of SceneState, optional
        Scene of each image; empty if unknown.

    Raises
    ------
    UserError
        If there is no picture.
    """

    def __init__(
        self,
        images: Sequence[Image],
        *,
        bits: int,
        exposure_s: float,
        black_dn: float = 0.0,
        scenes: Sequence[SceneState] = (),
    ) -> None:
        if not images:
            raise UserError("there is no picture to loop: request at least one")
        self._images, self._scenes, self._exposure_s = images, scenes, exposure_s
        self._full, self._black_dn = 2**bits - 1, black_dn
        self._table: tuple[float, Image] | None = None

    def take(self, request: ImageRequest) -> CapturedImage:
        """Return the next image, scaled to the controller's exposure and gain."""
        k = request.number % len(self._images)
        scene = self._scenes[k] if self._scenes else None
        image = self._images[k]
        # an automatic exposure changes from image to image
        taken_s = self._exposure_s if scene is None else scene.exposure_s
        factor = request.exposure_s / taken_s * 10 ** (request.gain_db / 20)
        if abs(factor - 1) < 1e-5:  # exposures are transmitted in single precision
            return CapturedImage(image, scene)
        if self._table is None or self._table[0] != factor:
            light = (np.arange(self._full + 1) - self._black_dn) * factor + self._black_dn
            self._table = (factor, np.clip(np.rint(light), 0, self._full).astype(image.dtype))
        return CapturedImage(self._table[1][image], None if scene is None else with_exposure(scene, request))


def with_exposure(scene: SceneState, request: ImageRequest) -> SceneState:
    """Return a scene with a controller's exposure and gain, which amplifies signal and noise before the converter."""
    gain = 10 ** (request.gain_db / 20)
    sensor = scene.sensor
    if sensor.detector is not None:
        detector = replace(sensor.detector, gain_e_per_dn=sensor.detector.gain_e_per_dn / gain)
        sensor = replace(sensor, detector=detector)
    else:
        sensor = replace(
            sensor,
            full_scale_j_m2_sr=sensor.full_scale_j_m2_sr / gain,
            gaussian_variance=sensor.gaussian_variance * gain**2,
        )
    return replace(scene, sensor=sensor, exposure_s=request.exposure_s)


def check_one_channel(plan: Plan) -> None:
    """Raise UserError for a plan whose images the endpoint cannot send.

    Raises
    ------
    UserError
        If the images are in colour or encoded.
    """
    if plan.bands != "mono":
        raise UserError(
            f"scenario {plan.scenario_name} renders {plan.bands} pictures, but the camera endpoint sends one channel:"
            ' write bands = "mono" under [output] of a copy of the scenario'
        )
    if plan.camera.pixel_encoding != "linear":
        raise UserError(
            f"scenario {plan.scenario_name} renders {plan.camera.pixel_encoding} pictures, but gain and exposure of "
            'the camera endpoint need linear ones: write encoding = "linear" under [output] of a copy of the scenario'
        )


def pixels_only(frame: Frame) -> Image:
    """Return the pixels of a frame.

    Returns
    -------
    (H, W) array
        Image of the frame, not a copy.
    """
    return frame.image


def render_loop(plan: Plan, *, device_index: int | None = None) -> LoopedPictures:
    """Render the plan's frames once for looping.

    Returns
    -------
    LoopedPictures
        Images with their scenes, in the order of the plan, each with its own exposure.
    """
    first = plan.scene(0)
    with open_frames(pixels_only, processes=1, device_index=device_index, first=first) as producer:
        images = list(run_frames(plan, producer, labels=False))
    detector = first.sensor.detector
    return LoopedPictures(
        images,
        bits=first.sensor.bits,
        exposure_s=first.exposure_s,
        black_dn=0.0 if detector is None else detector.black_level_dn,
        scenes=[plan.scene(k) for k in range(len(images))],
    )
