"""Time of a frame by scene and pass, and of a start. The longer benches are in `tools/bench`."""
