"""The camera measured as one measures a real one. `python -m tools.validation.camera` writes the page."""
