"""The commands of ``raceway``, a module each."""
