"""What a run leaves for other people's tools: MCAP and a live view, Chrome traces, CCSDS space packets."""
