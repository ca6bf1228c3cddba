"""Piloted flight: a session stepped by commands, with clock, manual control, guidance, autopilot and docking.

Commands and states are values. Keys, devices, windows and images do not belong here; control laws shared with planned
flights are in `flyaround.simulator.world.guidance`.
"""
