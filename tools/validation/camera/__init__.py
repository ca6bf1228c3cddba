"""The camera, measured like a real one. `python -m tools.validation.camera` writes the page."""
