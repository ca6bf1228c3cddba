"""Messages between the endpoint process and the renderer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from flyaround.hil.host.camera_endpoint.interface import Interface
    from flyaround.hil.host.camera_endpoint.registers import CameraTerms
    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.hil.host.link_process.ipc import LinkConfig
    from flyaround.hil.link.packets.messages import HelloAck


@dataclass(frozen=True)
class AnswerTerms:
    """Terms for a board that reads the stream: address, camera and target."""

    link: LinkConfig
    ack: HelloAck


@dataclass(frozen=True, kw_only=True)
class EndpointConfig:
    """Settings of the endpoint process.

    Parameters
    ----------
    interface : Interface
        Network interface of the endpoint.
    allowed : tuple of str
        Addresses that may send commands.
    terms : CameraTerms
        Properties of the simulated camera.
    xml : bytes
        GenICam description that is served.
    xml_name : str
        File name under which it is served.
    answers : AnswerTerms, optional
        Terms of the answer port; None without one.
    loss_share : float, optional
        Share of stream packets that are dropped, to test a client's resend requests.
    loss_seed : int, optional
        Seed of the random drops.
    """

    interface: Interface
    allowed: tuple[str, ...]
    terms: CameraTerms
    xml: bytes
    xml_name: str
    answers: AnswerTerms | None = None
    loss_share: float = 0.0
    loss_seed: int = 0


@dataclass(frozen=True)
class Opened:
    """Confirmation that the endpoint listens, with the URL for answers, if any."""

    answers_url: str | None = None


@dataclass(frozen=True)
class Note:
    """Note for the user."""

    sentence: str


@dataclass(frozen=True, kw_only=True)
class ImageRequest:
    """Request for an image that is due.

    Parameters
    ----------
    request_id : int
        Identifier that is returned with the image.
    number : int
        Frame number since the start of acquisition, from 0.
    t_s : float
        Flight time of mid-exposure.
    exposure_s : float
        Exposure time set by the controller.
    gain_db : float
        Gain set by the controller.
    """

    request_id: int
    number: int
    t_s: float
    exposure_s: float
    gain_db: float


@dataclass(frozen=True)
class ImageResult:
    """Image: digital numbers (H, W) of the whole detector."""

    request_id: int
    image: NDArray[np.unsignedinteger]


@dataclass(frozen=True)
class PictureOutcome:
    """Board's answer to an image; ``record`` is None if the image was not sent."""

    request_id: int
    record: FrameRecord | None


@dataclass(frozen=True)
class Stop:
    """Request to stop the camera; missing outcomes are reported first."""
