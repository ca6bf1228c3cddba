"""The Earth and its air: maps, tables, the part in view, the passes that draw it. Nothing of the spacecraft."""
