"""Many runs of the loop: a campaign of cases against requirements, and the map of what delays an approach bears.

A run here is a run of `flyaround.hil.host`; nothing flies, draws or sends by other means.
"""
