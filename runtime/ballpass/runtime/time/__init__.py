"""What turns, how often, and when: angles over time that are known before a run, and what changes with them."""
