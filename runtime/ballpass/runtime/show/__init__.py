"""How objects show themselves: short texts, tables of notebooks, progress of long calls."""
