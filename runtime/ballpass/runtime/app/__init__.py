"""Command line, tables, figures, files of results."""
