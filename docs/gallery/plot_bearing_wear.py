"""
Damage and wear of the raceways
===============================

The punch acts at one crank angle, so that one place of the inner ring meets it in every
turn. The outer ring stands still and takes the load at its top, where the crank pushes
the frame up.
"""

# %%
# `life` counts what every place of both raceways meets.
import matplotlib.pyplot as plt
import numpy as np

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

model = load(generate(shipped_scenes()["press"]))
bearing = model.life().bearings[0]
for name, ring in (("inner", bearing.inner), ("outer", bearing.outer)):
    print(
        f"{name} ring: {sum(ring.damage):.0%} of the damage,",
        f"most of it at {np.degrees(ring.worst_angle):.0f}°",
    )

# %%
# Wear follows pressure times slip, which is zero on two lines of the groove: it is
# deepest beside its middle. Four decades of the wear coefficient give a range, and the
# place is certain.
least, most = bearing.inner.wear
print(f"{1e6 * 3600 * least:.2g} to {1e6 * 3600 * most:.2g} µm in an hour")
print(
    f"deepest {1e3 * abs(bearing.inner.wear_across):.2f} mm",
    "beside the middle of the inner groove",
)

figure, axes = plt.subplots(
    1, 2, figsize=(8, 4), subplot_kw={"projection": "polar"}, layout="constrained"
)
for axis, name, ring in zip(
    axes, ("inner", "outer"), (bearing.inner, bearing.outer), strict=True
):
    share = np.asarray(ring.damage)
    angle = np.linspace(0, 2 * np.pi, len(share), endpoint=False)
    axis.bar(angle, 100 * share, width=2 * np.pi / len(share), align="edge")
    axis.set_title(f"{name} raceway, share of the damage [%]", fontsize=10)
    axis.set_rlabel_position(22)
    axis.set_rticks(axis.get_yticks()[::2])
    axis.tick_params(labelsize=8)
plt.show()
