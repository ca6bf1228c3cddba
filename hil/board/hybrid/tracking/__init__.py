"""Tracking: after an accepted pose, each frame is aligned on edges near their predicted positions."""
