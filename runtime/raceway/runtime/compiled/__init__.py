"""What a generated folder needs to run: compiled libraries, functions without overhead, export to plain C."""
