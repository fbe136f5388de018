"""Version of ballpass: of both distributions, of what they write, of what the command line says."""

__version__ = "0.1.0"
