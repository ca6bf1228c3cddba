"""Recorders of a run for other tools: MCAP and a live view, Chrome traces, CCSDS space packets."""
