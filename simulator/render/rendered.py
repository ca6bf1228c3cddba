"""What the renderer gives: a noise-free picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import Float32Array

Layer = Literal["all", "craft", "sky"]
"""What is drawn: everything; the target alone, in the scene's own light; or all that it hides, without it."""


@dataclass(frozen=True, eq=False)
class Rendered:
    """One noise-free picture.

    Parameters
    ----------
    radiance : (H, W) for mono, (H, W, 3) for rgb, row 0 at the top [W m-2 sr-1 in the band].
    coverage : (H, W) share of each pixel that the target covers; with labels only.
    depth_m : (H, W) camera z of the target's nearest surface at the pixel's centre, NaN outside; with labels only.
    silhouette_inside : share of the target's whole silhouette that falls on the image; with labels only.
    stage_ms : time spent per stage [ms].
    window : rows and columns that radiance and coverage are of; the whole image but for a craft alone.
    """

    radiance: Float32Array
    coverage: Float32Array | None
    depth_m: Float32Array | None
    silhouette_inside: float
    stage_ms: dict[str, float]
    window: tuple[slice, slice] = (slice(None), slice(None))
