"""From the text of a scene file to its records: reading rules of all parts, checks of values."""
