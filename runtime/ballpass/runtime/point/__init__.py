"""A model at one instant: derivatives, equilibrium, small vibrations, time scales."""
