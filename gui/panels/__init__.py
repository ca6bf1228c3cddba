"""Panels: figures and controls in dockable windows."""
