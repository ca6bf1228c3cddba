"""Piloted flight: a session stepped by commands, with clock, manual control, guidance, autopilot, docking, burns,
recording.

Commands and states are values. Names of keys, devices, windows and drawn images do not belong here; laws of motion
that a planned flight uses too stand in `flyaround.simulator.world.guidance`.
"""
