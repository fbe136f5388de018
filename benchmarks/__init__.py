"""Benchmarks: time and error of one cycle of the press against peers, ensembles, derivatives, preparation.

``python -m benchmarks`` measures and writes docs/benchmarks.md; ``--quick`` only shows that the scripts run.
"""
