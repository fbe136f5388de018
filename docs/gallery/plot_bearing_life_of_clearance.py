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
found = model.simulate_many(
    {"bearing.clearance": clearance}, ["life_sectors", "life_mean"], cycles=66
)

# %%
# `life_sectors` knows that the punch meets the same place of the inner raceway in every
# turn; `life_mean` averages.
sectors, mean = (
    np.asarray(found[name]) / 1e6 for name in ("life_sectors", "life_mean")
)
print(f"{sectors[0]:.0f} million turns without clearance, {sectors[-1]:.0f} with 30 µm")

figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
axes.plot(1e6 * clearance, sectors, label="every place of the raceways")
axes.plot(1e6 * clearance, mean, "--", label="averaged over the inner ring")
axes.axvspan(5, 20, color="0.92", label="group CN of ISO 5753-1")
axes.set(
    xlabel="clearance [µm]",
    ylabel="life L10 [million turns]",
    title="Life of the press's bearing",
)
axes.legend()
plt.show()
