"""Operator console: glfw and Dear ImGui. The only folder that imports them."""
