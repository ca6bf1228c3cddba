"""The camera: `lens` bends and projects, `detector` turns light into digital numbers. No GL, no world, no scene."""
