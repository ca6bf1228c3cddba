"""The Earth and its air: maps, tables, what of it is in view, the passes that draw it. Nothing of the spacecraft."""
