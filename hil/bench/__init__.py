"""Timing of the link and the estimator, used by `flyaround bench`."""
