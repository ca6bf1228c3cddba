"""Many runs of the loop: campaigns of cases against requirements, and maps of tolerable pose delays.

A run here is a run of `flyaround.hil.host`; nothing flies, draws or sends by other means.
"""
