"""Navigation on pose measurements: filter, guidance, and the closed loop of both. Independent of any board."""
