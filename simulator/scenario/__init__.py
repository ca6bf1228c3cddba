"""Typed scenario, recipe and range files: loading, checking, showing and writing; and plans of flights.

The types of their sections are defined in the folders that use them. No GL, no frames.
"""
