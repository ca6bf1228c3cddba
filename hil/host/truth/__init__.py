"""Ground truth on an endpoint of its own, and a logger that receives it. Nothing here reaches a board."""
