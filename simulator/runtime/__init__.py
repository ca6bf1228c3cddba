"""Runtime services for all other folders: processes, threads, memory, the cache, files, array types.

It knows nothing of spacecraft or images.
"""
