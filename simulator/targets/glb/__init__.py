"""Target files: a target to and from binary glTF 2.0, to the bit. Files of others are read by importing/."""
