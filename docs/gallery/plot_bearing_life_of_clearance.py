"""
Life against clearance
======================

How long the bearing of the press lasts, over the clearance that is fitted. The rating
life comes from the simulated ball forces at every place of both raceways.
"""

# %%
# Lives are quantities like others: an ensemble has one for each member.
import matplotlib.pyplot as plt
import numpy as np

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

model = load(generate(shipped_scenes()["press"]))
clearance = np.linspace(0, 30e-6, 16)
found = model.simulate_many({"bearing.clearance": clearance}, ["life"], cycles=66)

# %%
# The life knows that the punch meets the same place of the inner raceway in every turn.
life = np.asarray(found["life"]) / 1e6
print(f"{life[0]:.0f} million turns without clearance, {life[-1]:.0f} with 30 µm")

figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
axes.plot(1e6 * clearance, life)
axes.axvspan(5, 20, color="0.92", label="group CN of ISO 5753-1")
axes.set(
    xlabel="clearance [µm]",
    ylabel="life L10 [million turns]",
    title="Life of the press's bearing",
)
axes.legend()
plt.show()
