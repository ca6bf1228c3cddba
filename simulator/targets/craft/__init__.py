"""The fleet: one file or folder per craft, each with a function ``build_...(detail)``, and what they share."""
