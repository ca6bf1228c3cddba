"""Passes that spare a software driver work: tiles, interpolation, culling on the CPU.

`software_path.software_passes` puts them in the place of the plain ones, which a GPU runs. Beside each saving stands
what it is worth: the processor time that a frame of each of the eight bench scenes takes more without it, added up, of
800 ms for the eight (two llvmpipe threads, 2026-11-28). `python -m tools.studies.savings` measures them;
docs/lab/2026-11-savings.md has the table.
"""
