"""Samplers, capture, writers and the checks that re-verify a data set."""
