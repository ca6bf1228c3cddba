"""One file per command group of the command line; each only parses, calls and prints."""
