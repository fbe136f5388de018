"""Many parameter sets of one model at once."""
