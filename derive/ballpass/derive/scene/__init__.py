"""Scene files: records, units, messages of faults, and the helpers of the reading rules."""
