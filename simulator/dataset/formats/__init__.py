"""Layouts and encodings of data sets on disk."""
