"""Rotations, poses, the LVLH frame and products of small vectors: geometry, no physics."""
