"""
A four-bar of your own
======================

Lengths are parameters: they change without deriving or compiling. A linkage that does
not close is refused, with the joint and the angle where it fails.

`Play with this machine <../live/four_bar.html>`__ in its live page.
"""

# %%
# The path of the joint between coupler and rocker, for three lengths of the crank.
import matplotlib.pyplot as plt
import numpy as np

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import RequestError, load

model = load(generate(shipped_scenes()["four-bar"]))
info = model.parameters.info("mechanism.bodies.crank.points.B")
print(info.description, info.default, info.unit)

# %%
# With the crank's length go the forces at its bearing.
figure, axes = plt.subplots(figsize=(8, 3.8), layout="constrained")
for length, style in ((0.02, ":"), (0.03, "-"), (0.036, "--")):
    run = model.simulate(
        cycles=3, transient=2, parameters={"mechanism.bodies.crank.points.B": length}
    ).steady()
    force = np.hypot(run["reaction.A.x"], run["reaction.A.y"])
    print(f"crank of {1e3 * length:.0f} mm: up to {force.max():.0f} N on the bearing")
    axes.plot(
        np.linspace(0, 360, len(force)), force, style, label=f"{1e3 * length:.0f} mm"
    )
axes.set(
    xlabel="crank angle [°]",
    ylabel="force of the crank on the frame [N]",
    title="Bearing load of a four-bar",
)
axes.legend(title="crank")
plt.show()

# %%
# Too long a crank cannot turn all around.
try:
    model.simulate(cycles=1, parameters={"mechanism.bodies.crank.points.B": 0.08})
except RequestError as refused:
    print(str(refused).partition(" (")[0])
