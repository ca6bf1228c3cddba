"""Measurement of the simulated camera like a real one; `python -m tools.validation.camera` writes the page."""
