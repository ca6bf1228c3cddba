"""Messages between the endpoint's process and the renderer."""

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
    """Connection of a board that reads the stream, with camera and target."""

    link: LinkConfig
    ack: HelloAck


@dataclass(frozen=True, kw_only=True)
class EndpointConfig:
    """Settings of the endpoint's process.

    Parameters
    ----------
    allowed : tuple of str
        Addresses that are heard.
    xml : bytes
        The GenICam description and the file name it is served under.
    xml_name : str
        The GenICam description and the file name it is served under.
    answers : AnswerTerms, optional
        Address at which boards send their poses; None for none.
    loss_share : float, optional
        Stream packets that are left out, to try a client's requests.
    loss_seed : int, optional
        Seed of their choice.
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
    """Confirmation that the endpoint listens, with the address for answers, if any."""

    answers_url: str | None = None


@dataclass(frozen=True)
class CameraFailed:
    """Failure of the endpoint to listen; one sentence."""

    sentence: str


@dataclass(frozen=True)
class Note:
    """Note for the user."""

    sentence: str


@dataclass(frozen=True, kw_only=True)
class FrameWanted:
    """Request for an image that is due.

    Parameters
    ----------
    request_id : int
        Comes back with the image.
    number : int
        Since acquisition started, from 0.
    t_s : float
        Its time.
    exposure_s, gain_db : float
        Settings of the controller.
    """

    request_id: int
    number: int
    t_s: float
    exposure_s: float
    gain_db: float


@dataclass(frozen=True)
class FrameTaken:
    """Image: (H, W) digital numbers of the whole detector."""

    request_id: int
    image: NDArray[np.unsignedinteger]


@dataclass(frozen=True)
class PictureOutcome:
    """Board's answer to an image; ``record`` is None if the image was not sent."""

    request_id: int
    record: FrameRecord | None


@dataclass(frozen=True)
class Stop:
    """Request to end the camera; missing outcomes are reported first."""
