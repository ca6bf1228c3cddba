"""Data sets: capture, formats, storage, and the verification of their labels."""
