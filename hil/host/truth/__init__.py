"""Ground truth on a separate endpoint, and a logger that receives it. Nothing here reaches a board."""
