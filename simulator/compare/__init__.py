"""Comparison of simulated images with those of other data sets: statistics, most similar views, and a report page."""
