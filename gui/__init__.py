"""Operator console: glfw and Dear ImGui. The only folder that imports them.

`session`, `keys`, `feed` and `readout` are plain logic and import neither; `window`, `panels`, `overlay` and
`app` draw.
"""
