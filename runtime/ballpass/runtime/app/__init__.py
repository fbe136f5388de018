"""Command line, tables, files of results."""
