"""Positions, orientations and shadows of Earth, Moon and Sun. No spacecraft."""
