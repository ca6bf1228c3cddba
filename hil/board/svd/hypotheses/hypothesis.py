"""One picture on its way through the stages, the craft it may show, and what is said of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hil.board.svd.hypotheses.edge_support import Support
from hil.board.svd.image.edge_field import EdgeField
from hil.board.svd.image.region import Region

Array = np.ndarray


# Of poses that edges have not been asked about.
UNASKED = Support(0.0, 0.0, 0.0, 0.0, np.zeros(0, int))


@dataclass(frozen=True, eq=False)
class Candidate:
    """A pose with its evidence, and the region and edges that gave it.

    Parameters
    ----------
    support : by edges; ``UNASKED`` where the learned proposal proposed the pose.
    likely : logarithm of its likelihood by the learned proposal over that of the best of its region; zero for others.
    """

    q: Array
    t: Array
    support: Support
    field: EdgeField
    region: Region
    likely: float = 0.0
