"""The world against theory and independent programs. `python -m tools.validation.dynamics` writes the page."""
