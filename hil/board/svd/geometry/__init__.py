"""Rotations, vectors and the camera: no picture, no target, nothing compiled."""
