"""Random draws of a recipe for one frame, recorded in its truth."""

from __future__ import annotations

import msgspec

from flyaround.simulator.runtime.arrays import Quat, Vec3


class RawPose(msgspec.Struct, frozen=True, kw_only=True):
    """A pose as drawn in Euler angles: left-handed axes, x right, y up, z forward.

    Attributes
    ----------
    position_m : origin of the model.
    euler_deg : rotations about fixed axes x, y and z, in that order.
    q_wxyz : the same rotation. In the camera's right-handed axes (y down) these are x, -y, z and w, -x, y, -z.
    """

    position_m: Vec3
    euler_deg: Vec3
    q_wxyz: Quat


class BackgroundView(msgspec.Struct, frozen=True, kw_only=True):
    """A view of a background library: its body, the library, and the view's number in it."""

    body: str
    library_seed: int
    id: int


class SequenceStep(msgspec.Struct, frozen=True, kw_only=True):
    """The sequence that a frame belongs to, and its index in it."""

    sequence: int
    step: int


class PairMember(msgspec.Struct, frozen=True, kw_only=True):
    """A frame's role in a ``pair`` of frames that differ only in the environment, which this names."""

    pair: int
    environment: str


class VariedBy(msgspec.Struct, frozen=True, kw_only=True):
    """Variations of a frame; the scene holds the resulting values.

    Attributes
    ----------
    exposure, noise : factors, noise on standard deviations.
    psf_sigma_px : width of the Gaussian PSF.
    pedestal_dn : the detector's black level.
    glow_share : glow of the optics.
    boxes : number of area lights.
    lamp : True if a lamp is lit.
    environment : name of the layers, or empty.
    craft : number of the varied craft, which is described in the scene's target.
    """

    exposure: float = 1.0
    noise: float = 1.0
    psf_sigma_px: float | None = None
    pedestal_dn: float | None = None
    glow_share: float | None = None
    boxes: int | None = None
    lamp: bool = False
    earthshine: bool | None = None
    environment: str = ""
    craft: int | None = None


class Sample(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Random draws of a recipe for one frame.

    Attributes
    ----------
    redraws : number of poses drawn again for each of the recipe's constraints.
    raw : Euler angles, if the attitude was drawn by them.
    background : the view of a library, if used.
    pair, sequence : group of frames.
    varied : changes by `--vary` or a recipe's [vary].
    """

    redraws: dict[str, int] = msgspec.field(default_factory=dict)
    raw: RawPose | None = None
    background: BackgroundView | None = None
    pair: PairMember | None = None
    sequence: SequenceStep | None = None
    varied: VariedBy | None = None
