"""The world against physics and independent programs. `python -m tools.validation.dynamics` writes the page."""
