"""Tracking: from one accepted pose on, each frame is aligned on the edges near where the last ones put them."""
