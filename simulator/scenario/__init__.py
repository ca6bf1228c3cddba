"""The typed scenario file: reading, checking, showing and writing it, the flight it asks for, and recipes.

Its sections are the types that the simulation uses and live in the rooms below. No GL, no frames.
"""
