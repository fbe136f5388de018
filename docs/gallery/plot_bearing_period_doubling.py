"""
A rotor that repeats after two ball passes
==========================================

A rotor in a ball bearing moves with each ball that passes under the load. Between two
speeds the motion repeats only after two of them. Its periodic states, stable or not,
and the values that runs end on.
"""

# %%
# The branch of periodic states over the speed of the shaft, followed by shooting. Where
# a multiplier passes -1 a branch of twice the period begins.
import matplotlib.pyplot as plt

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

model = load(generate(shipped_scenes()["varying-compliance"]))
states = model.steady(over="shaft.speed=1950 rpm:1975 rpm")
for branch in states.branches:
    for point in branch.special:
        print(f"{point.kind} at {point.value / states.over.factor:.2f} rpm")

# %%
# Readings once in a ball pass, as a stroboscope has them, each value from where the
# motion at the value before ended: grey. The branch of twice the period, red, has one
# of two states between which runs go to and fro.
values = "shaft.speed=1950 rpm:1975 rpm:26"
runs = model.bifurcation(values, readings=20, settling=2000, exponent=False)

figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
for motion in runs.up:
    place = [motion.value / runs.vary.factor] * len(motion.states)
    axes.plot(place, 1e6 * motion.states[:, runs.row], ".", color="0.6", markersize=5)
for branch, color in zip(states.branches, ("tab:blue", "tab:red"), strict=True):
    for stable, style in ((True, "-"), (False, ":")):
        points = [point for point in branch.points if point.stable == stable]
        points.sort(key=lambda point: point.value)
        axes.plot(
            [point.value / states.over.factor for point in points],
            [1e6 * point.nodes[0, runs.row] for point in points],
            style,
            color=color,
        )
axes.set(xlabel="speed of the shaft [rpm]", ylabel="y of the rotor [µm]")
plt.show()
