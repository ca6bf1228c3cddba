"""Method of Sharma, Ventura & D'Amico (2018) and the variant of the Milan thesis, as published; NumPy and OpenCV only.

One file per stage, in the order of the pipeline: ``weak_gradients``, ``region_of_interest``, ``line_streams`` (with
``ellipses``, an option), ``segment_merging``, ``perceptual_groups`` and ``wireframe_groups``, ``correspondence``,
``pose_solvers``, ``refinement``. ``pipeline`` runs them; ``settings`` holds the differences between the two variants.
Nothing here imports ``hybrid`` or compiled code.
"""
