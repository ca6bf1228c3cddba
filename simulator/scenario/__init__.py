"""Typed scenario, recipe and range files: loading, checking, showing and writing them; plans of flights.

Its sections are the types that the simulation uses and live in the rooms below. No GL, no frames.
"""
