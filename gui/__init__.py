"""Operator console: glfw and Dear ImGui. The only folder that imports them.

`session`, `keys`, `manual_control`, `feed`, `telemetry` and `truth_overlay` are plain logic and import neither;
`window`, `panels`, `viewport` and `app` draw.
"""
