"""Ledger files: rows of frames in frames.csv, and their summary."""
