"""Passes optimised for software drivers: tiles, interpolation, culling on the CPU.

`software_path.software_passes` substitutes them for the plain ones, which a GPU runs. `python -m tools.studies.savings`
measures the time that each optimisation saves; docs/lab/2026-11-savings.md has the table.
"""
