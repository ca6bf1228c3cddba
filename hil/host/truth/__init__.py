"""Ground truth on a separate endpoint, and a logger that receives it. Nothing here is sent to a board."""
