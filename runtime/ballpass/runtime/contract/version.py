"""Version of ballpass: of both distributions, of the files they write, of the command line."""

__version__ = "0.1.0"
