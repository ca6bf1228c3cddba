"""What every room stands on: processes, threads, memory, the cache, files, names of arrays.

Nothing of spacecraft or pictures.
"""
