"""What accuracy costs, and runs to a named error."""
