"""Camera faults: pixels change, the truth stays, and each frame lists its faults."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.scenario.faults import (
    Blinding,
    ColumnLoss,
    DeadPixels,
    FrozenPicture,
    GainStep,
    HalfFrame,
    RepeatedNumber,
    RowLoss,
    StuckExposure,
    StuckPixels,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from flyaround.simulator.frame import Frame
    from flyaround.simulator.scenario.faults import CameraFault, Faults
    from flyaround.simulator.scenario.plan import Exposures, Plan

    Pixels = NDArray[np.unsignedinteger]


def with_camera_faults(frames: Iterable[Frame], faults: Faults) -> Iterator[Frame]:
    """Yield frames as the faulty camera delivers them; ``faults`` of each frame lists the causes.

    The same frames and seed give the same bytes.
    """
    frozen_images: dict[int, Pixels] = {}
    previous: Pixels | None = None
    for frame in with_camera_numbers(frames, faults):
        image, names = frame.image, list(frame.faults)
        t_s, white = frame.scene.t_s, 2**frame.scene.sensor.bits - 1
        for k, fault in enumerate(faults.camera):
            if not fault.acts(t_s):
                continue
            if isinstance(fault, FrozenPicture):
                changed: Pixels | None = frozen_images.setdefault(k, image if previous is None else previous)
            else:
                changed = _apply_fault(image, fault, (faults.seed, k), frame.number, white)
            if changed is not None:
                image = changed
                names.append(fault.name)
        previous = image
        names += [f.name for f in faults.camera if isinstance(f, StuckExposure) and f.acts(t_s)]
        yield replace(frame, image=image, faults=tuple(names)) if names else frame


def with_camera_numbers(frames: Iterable[Frame], faults: Faults) -> Iterator[Frame]:
    """Yield frames with the camera's own counter, which repeats its last number under `RepeatedNumber`.

    Frames that already have one keep it.
    """
    counter: int | None = None
    for frame in frames:
        if frame.camera_frame is not None:
            yield frame
            continue
        names = []
        for k, fault in enumerate(faults.camera):
            if isinstance(fault, RepeatedNumber) and fault.acts(frame.scene.t_s) and counter is not None:
                rng = np.random.default_rng((faults.seed, k, frame.number))
                if rng.random() < fault.chance:
                    names.append(fault.name)
        counter = counter if names and counter is not None else frame.number
        yield replace(frame, camera_frame=counter, faults=(*frame.faults, *names))


def with_exposure_faults(plan: Plan, faults: Faults) -> Plan:
    """Return the plan with automatic exposure stuck during such a fault; a fixed exposure is unaffected."""
    track = plan.exposures
    stuck = tuple(fault for fault in faults.camera if isinstance(fault, StuckExposure))
    if track is None or not stuck:
        return plan
    return replace(plan, exposures=StuckExposureTrack(track, stuck))


@dataclass(frozen=True, eq=False)
class StuckExposureTrack:
    """Automatic exposure that is constant during a fault."""

    track: Exposures
    stuck: tuple[StuckExposure, ...]

    def exposure_s(self, t_s: float) -> float:
        """Return the exposure time at a time of the flight [s]."""
        for fault in self.stuck:
            if fault.acts(t_s):
                return self.track.exposure_s(fault.start_s)
        return self.track.exposure_s(t_s)


def _apply_fault(
    image: Pixels, fault: CameraFault, key: tuple[int, int], number: int, white: int
) -> Pixels | None:
    """Return the image with one fault applied; None if the fault is inactive or does not affect pixels."""
    camera = np.random.default_rng(key)  # random numbers that are the same for every frame
    frame = np.random.default_rng((*key, number))
    height, width = image.shape[:2]
    if isinstance(fault, StuckPixels):
        mask = camera.random((height, width)) < fault.share
        levels = camera.integers(0, white, (height, width), endpoint=True).astype(image.dtype)
        return _replace_pixels(image, mask, levels)
    if isinstance(fault, DeadPixels):
        mask = camera.random((height, width)) < fault.share
        return _replace_pixels(image, mask, np.zeros((height, width), image.dtype))
    if isinstance(fault, RowLoss):
        if frame.random() >= fault.chance:
            return None
        changed = image.copy()
        changed[frame.choice(height, min(fault.rows, height), replace=False)] = 0
        return changed
    if isinstance(fault, ColumnLoss):
        changed = image.copy()
        changed[:, camera.choice(width, min(fault.columns, width), replace=False)] = 0
        return changed
    if isinstance(fault, HalfFrame):
        if frame.random() >= fault.chance:
            return None
        changed = image.copy()
        changed[round(fault.at * height) :] = 0
        return changed
    if isinstance(fault, Blinding):
        rows, columns = np.mgrid[:height, :width]
        distance = np.hypot(columns - fault.x * width, rows - fault.y * height) / max(
            fault.radius * width, 1e-9
        )
        # glare falls off steeply, so that the rest of the image stays readable; the power is chosen by eye
        light = white * np.minimum(1.0, np.maximum(distance, 1e-9) ** -4)
        light = light if image.ndim == 2 else light[..., None]
        return np.minimum(white, np.rint(image + light)).astype(image.dtype)
    if isinstance(fault, GainStep):
        return np.minimum(white, np.rint(fault.factor * image.astype(np.float64))).astype(image.dtype)
    return None


def _replace_pixels(image: Pixels, mask: NDArray[np.bool_], levels: Pixels) -> Pixels:
    if image.ndim > mask.ndim:
        mask, levels = mask[..., None], levels[..., None]
    return np.where(mask, levels, image).astype(image.dtype)
