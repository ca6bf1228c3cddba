"""What spares a software driver work, behind one interface: tiles, interpolation, culling on the CPU.

The plain path, which a GPU runs, never comes here. Beside each saving stands what it is worth: the processor time that
a frame of each of the eight bench scenes takes more without it, added up, of 800 ms for the eight (two llvmpipe
threads, 2026-11-28). `python -m tools.studies.savings` measures them; docs/lab/2026-11-savings.md has the table.
"""
