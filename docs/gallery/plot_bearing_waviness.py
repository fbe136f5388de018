"""
Which waves move the ring
=========================

Waves on the inner raceway of a bearing with Z balls move the ring as a whole only where
their number is k Z ± 1. Other numbers of waves cancel around the balls.
"""

# %%
# Waves of one amplitude: their numbers are structure, so all are in one scene, at first
# with zero amplitude.
from pathlib import Path

import matplotlib.pyplot as plt

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

orders = range(5, 12)
waves = "\n[bearing.inner_waviness]\n" + "".join(
    f'{n} = {{ amplitude = "0 um" }}\n' for n in orders
)
Path("generated").mkdir(exist_ok=True)
scene = Path("generated/wavy_rotor.toml")
scene.write_text(shipped_scenes()["rotor"].read_text() + waves)
model = load(generate(scene))

# %%
# One run for each number of waves, in a preloaded bearing without unbalance and weight.
# `reduce` keeps extremes and no samples.
quiet = {
    "bearing.clearance": -8e-6,
    "loads.weight.force.y": 0.0,
    "loads.unbalance.mass": 0.0,
}
motion = []
for n in orders:
    wavy = quiet | {f"bearing.inner_waviness.{n}.amplitude": 0.2e-6}
    found = model.reduce(cycles=30, transient=15, parameters=wavy)
    motion.append(1e9 * found["inner.y"].range / 2)

# %%
# Eight balls: 7 and 9.
moving = [n for n, size in zip(orders, motion, strict=True) if size > 0.1 * max(motion)]
print("these move the ring:", *moving)

figure, axes = plt.subplots(figsize=(8, 3.4), layout="constrained")
axes.bar(orders, motion)
axes.set_xticks(orders)
axes.set(
    xlabel="waves on the inner raceway",
    ylabel="motion of the ring [nm]",
    title="Seven and nine waves move a ring on eight balls",
)
plt.show()
