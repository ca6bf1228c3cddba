"""What this package adds to Flyaround; each part in a file of its own."""

from importlib.resources import files

NEAR = files("flyaround_example") / "near.toml"
