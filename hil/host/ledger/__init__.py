"""One row a frame in frames.csv, and the summary of all. Reads and writes files only."""
