"""Target files: a target as binary glTF 2.0, exact to the bit. Other files are read by importing/."""
