"""Boards held against the host: an emulated one, and how far the answers of any two agree."""
