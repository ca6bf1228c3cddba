"""Frame time by scene and pass, and start-up time. Longer benches are in `tools/bench`."""
