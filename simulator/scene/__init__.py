"""SceneState, a frozen snapshot of the world at mid-exposure (float64, no GL), and how it is built."""
