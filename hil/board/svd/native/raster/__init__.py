"""Faces on an image: rasteriser, shadow map, Sun search, hidden-edge removal; C, and its calls."""
