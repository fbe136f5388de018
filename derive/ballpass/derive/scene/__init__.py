"""Scene files: records, units, words of faults, and what reading rules are made of."""
