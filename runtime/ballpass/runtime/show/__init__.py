"""Short texts of objects, tables of notebooks, progress of long calls."""
