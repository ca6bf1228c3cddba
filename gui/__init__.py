"""Operator console: glfw and Dear ImGui. The only folder that imports them.

`picture`, `jobs`, `commands`, `console`, `command_table` and `script` are plain logic and import neither; `window`,
`views`, `panels`, `layout` and `app` draw.
"""
