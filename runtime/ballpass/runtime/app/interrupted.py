"""What an interrupted command says; it imports nothing, so that it can be said while modules are imported."""

INTERRUPTED = "interrupted. Whatever files are there are whole."
