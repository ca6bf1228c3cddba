"""Random draws of a recipe for one frame, recorded in its truth."""

from __future__ import annotations

import msgspec

from flyaround.simulator.runtime.arrays import Quat, Vec3


class RawPose(msgspec.Struct, frozen=True, kw_only=True):
    """A pose as drawn in Euler angles: left-handed axes, x right, y up, z forward.

    Attributes
    ----------
    position_m : array
        Origin of the model.
    euler_deg : array
        Rotations about fixed axes x, y and z, in that order.
    q_wxyz : array
        The same rotation, from the target to the left-handed camera axes. In the camera's right-handed axes, y down,
        t = (x, -y, z) and q = (w, -x, y, -z).
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
    """Number of a frame's sequence, and the index of the frame in it."""

    sequence: int
    step: int


class PairMember(msgspec.Struct, frozen=True, kw_only=True):
    """A frame's role in a pair of frames that differ only in the environment.

    Attributes
    ----------
    pair : int
        Number of the pair.
    environment : str
        Name of this frame's environment preset.
    """

    pair: int
    environment: str


class VariedBy(msgspec.Struct, frozen=True, kw_only=True):
    """Variations of a frame; the scene holds the resulting values.

    Attributes
    ----------
    exposure : float
        Factor on the exposure.
    noise : float
        Factor on the standard deviations of the noise.
    psf_sigma_px : float or None
        Width of the Gaussian PSF.
    pedestal_dn : float or None
        The detector's black level.
    glow_share : float or None
        Share of the light in the wide tail of the PSF, `Optics.glow_share`.
    boxes : int or None
        Number of area lights.
    lamp : bool
        True if a lamp is lit.
    earthshine : bool or None
        Whether bodies light the target; None if it is not varied.
    environment : str
        Name of an environment preset; empty if it is not varied.
    craft : int or None
        Number of the varied craft, which is described in the scene's target.
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
    redraws : dict
        Number of poses drawn again for each of the recipe's constraints.
    raw : RawPose or None
        Euler angles, if the attitude was drawn by them.
    background : BackgroundView or None
        The view of a library, if used.
    pair : PairMember or None
        The frame's role in its pair, if it has one.
    sequence : SequenceStep or None
        The frame's place in its sequence, if it has one.
    varied : VariedBy or None
        Changes by `--vary` or a recipe's [vary].
    """

    redraws: dict[str, int] = msgspec.field(default_factory=dict)
    raw: RawPose | None = None
    background: BackgroundView | None = None
    pair: PairMember | None = None
    sequence: SequenceStep | None = None
    varied: VariedBy | None = None
