"""The commands of ``ballpass``, a module each."""
