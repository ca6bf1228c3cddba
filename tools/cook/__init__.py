"""Makes the data files of assets/ from their sources."""
