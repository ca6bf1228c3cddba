"""The fleet: one file or folder per craft, each with a function `build_...(detail)`; nothing here draws or loads."""
