"""Numbers that a run is asked for: peaks, means, frequencies, with their derivatives."""
