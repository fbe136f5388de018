"""Scene files: records, units, reading rules, checks."""
