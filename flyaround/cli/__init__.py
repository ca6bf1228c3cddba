"""Command groups, one file each: they parse options, call the library and print."""
