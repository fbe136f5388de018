"""How far a number can be trusted: differences, certificates, ``--error``, trade."""
