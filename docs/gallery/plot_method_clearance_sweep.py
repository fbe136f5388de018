"""
A clearance sweep
=================

Two hundred presses that differ in clearance, simulated at once. Eight of them advance
together in the lanes of one processor core.
"""

# %%
# Only what is named is kept, so memory does not grow with the runs.
import matplotlib.pyplot as plt
import numpy as np

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

model = load(generate(shipped_scenes()["press"]))
clearance = np.linspace(0, 40e-6, 200)
found = model.simulate_many(
    {"bearing.clearance": clearance},
    ["peak_ball_force", "rms:inner.y"],
    cycles=4,
    transient=2,
)
peak, rms = np.asarray(found["peak_ball_force"]), np.asarray(found["rms:inner.y"])
print(f"{len(peak)} members, {len(found.failures)} failures")
print(f"highest ball force {peak.min():.0f} N to {peak.max():.0f} N")

# %%
# Both grow with the clearance, and nearly evenly.
slope = np.polyfit(clearance, peak, 1)[0]
print(f"{slope / 1e6:.0f} N for each µm of clearance")

figure, (top, bottom) = plt.subplots(
    2, 1, sharex=True, figsize=(8, 4.6), layout="constrained"
)
top.plot(1e6 * clearance, peak / 1e3)
top.set(ylabel="highest ball force [kN]", title="Press over its clearance")
bottom.plot(1e6 * clearance, 1e6 * rms)
bottom.set(xlabel="clearance [µm]", ylabel="rms of y [µm]")
plt.show()
