"""Rows of frames in frames.csv, and their summary. Reads and writes files only."""
