"""
Natural frequencies under load
==============================

A loaded bearing stiffens with its load. `linearize` finds where the rings rest under a
load and gives the matrices and modes of small vibrations about that place.
"""

# %%
# The rotor under loads from 10 N to 10 kN.
import matplotlib.pyplot as plt
import numpy as np

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

model = load(generate(shipped_scenes()["rotor"]))
loads = np.logspace(1.5, 4, 26)
modes = [
    model.linearize(
        parameters={"loads.weight.force.y": -load, "loads.unbalance.mass": 0.0}
    ).natural_frequencies
    for load in loads
]
low, high = np.transpose(modes)

# %%
# Hertz: the stiffness grows with the cube root of the load, the frequency with its
# sixth root.
slope = np.polyfit(np.log(loads[-8:]), np.log(high[-8:]), 1)[0]
print(
    f"along the load: {high[0]:.0f} Hz to {high[-1]:.0f} Hz,",
    f"at last with the load to the power {slope:.3f}",
)

figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
axes.loglog(loads, high, label="stiffer direction, along the load")
axes.loglog(loads, low, "--", label="softer direction, across it")
axes.loglog(
    loads,
    high[-1] * (loads / loads[-1]) ** (1 / 6),
    ":",
    color="grey",
    label="sixth root of the load",
)
axes.set(
    xlabel="load [N]",
    ylabel="natural frequency [Hz]",
    title="A rotor of 5 kg in a 6204",
)
axes.legend()
plt.show()
