"""Times the link and the estimator; `flyaround bench` composes these with the simulator's own bench."""
