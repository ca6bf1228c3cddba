"""Pictures of each stage's results, for people; an estimate never needs them."""
