"""Streams frames to a board, keeps the timing ledger and the truth endpoint."""
