"""Tests of the labels of random frames by other methods; `python -m tools.validation.labels` writes the page."""
