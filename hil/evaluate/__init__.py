"""Evaluation of any estimator against labelled frames: errors and metrics."""
