"""Example plugins of a package for Flyaround, one module for each kind."""

from importlib.resources import files

NEAR = files("flyaround_example") / "near.toml"
