"""One row a frame in frames.csv, its summary, and the report made of both. Reads and writes files only."""
