"""Tracking: after an accepted pose, each frame is aligned on the edges near their predicted places."""
