"""Piloted flight of the chaser: a session that is stepped, control by hand, guidance, autopilot, docking, propellant.

Commands and states are values; nothing here knows keys, windows or pictures.
"""
