"""Public types for plug-ins: sensors, formats, recipes, estimators, targets and bodies of other packages.

`docs/plugins.md` describes the entry points of each group.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from flyaround.lazy import lazy_names

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from flyaround.hil.board.answering import BoardEstimator, Estimate
    from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics, PoseResult
    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.formats.base import DatasetFormat, FormatOutput, FormatWriter
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame
    from flyaround.simulator.dataset.formats.posed_pictures import PosedPictures
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.labels.truth import Truth
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.ephemeris.body import Body, BodyAir, q_fixed_from_pole
    from flyaround.simulator.world.ephemeris.sun_moon import sun_geometric_m
    from flyaround.simulator.world.time.instant import Instant

__all__ = [
    "BoardEstimator",
    "BoardModel",
    "Body",
    "BodyAir",
    "CameraIntrinsics",
    "DatasetCard",
    "DatasetFormat",
    "Estimate",
    "FormatOutput",
    "FormatWriter",
    "Frame",
    "Instant",
    "LabelledFrame",
    "PoseResult",
    "PosedPictures",
    "Sensor",
    "Target",
    "Truth",
    "q_fixed_from_pole",
    "sun_geometric_m",
]


class Sensor(Protocol):
    """Function that measures something in a rendered frame (group ``flyaround.sensors``)."""

    def __call__(self, frame: Frame, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
        """Return the measured arrays by name.

        Parameters
        ----------
        frame : Frame
            Image, radiance, depth and truth.
        rng : numpy.random.Generator
            Only source of random numbers; it depends on seed, frame and sensor.
        """
        ...


__getattr__ = lazy_names(
    __name__,
    {
        "BoardEstimator": "flyaround.hil.board.answering",
        "BoardModel": "flyaround.hil.board.estimation",
        "Body": "flyaround.simulator.world.ephemeris.body",
        "BodyAir": "flyaround.simulator.world.ephemeris.body",
        "CameraIntrinsics": "flyaround.hil.board.estimation",
        "DatasetCard": "flyaround.simulator.dataset.card",
        "DatasetFormat": "flyaround.simulator.dataset.formats.base",
        "Estimate": "flyaround.hil.board.answering",
        "FormatOutput": "flyaround.simulator.dataset.formats.base",
        "FormatWriter": "flyaround.simulator.dataset.formats.base",
        "Frame": "flyaround.simulator.frame",
        "Instant": "flyaround.simulator.world.time.instant",
        "LabelledFrame": "flyaround.simulator.dataset.formats.labelled_frame",
        "PoseResult": "flyaround.hil.board.estimation",
        "PosedPictures": "flyaround.simulator.dataset.formats.posed_pictures",
        "Target": "flyaround.simulator.targets.model",
        "Truth": "flyaround.simulator.labels.truth",
        "q_fixed_from_pole": "flyaround.simulator.world.ephemeris.body",
        "sun_geometric_m": "flyaround.simulator.world.ephemeris.sun_moon",
    },
)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
