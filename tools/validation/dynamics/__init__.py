"""Validation of the world's dynamics; `python -m tools.validation.dynamics` writes the page."""
