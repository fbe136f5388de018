"""
Varying compliance
==================

A rotor under a constant load moves although nothing shakes it: the balls pass under the
load, and the bearing is stiffer when a ball stands right below it than when two stand
beside it.

`Play with this machine <../live/varying_compliance.html>`__ in its live page.
"""

# %%
# A bearing without a mechanism: two degrees of freedom and eight balls.
import matplotlib.pyplot as plt

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load
from ballpass.runtime.quantity.characteristic import frequencies_of

model = load(generate(shipped_scenes()["varying-compliance"]))
frequencies = frequencies_of(model.manifest.bearing, model.numbers().values)
print(f"balls pass the load {frequencies.ball_pass_outer:.2f} times a second")

# %%
# The clearance is diametral. With it the load rests on fewer balls, and the path grows.
figure, axes = plt.subplots(figsize=(6, 5), layout="constrained")
for clearance, style in ((0.0, "-"), (5e-6, "--"), (10e-6, ":")):
    run = model.simulate(
        parameters={"bearing.clearance": clearance}, outputs=["inner.x", "inner.y"]
    ).steady()
    x, y = 1e6 * run["inner.x"], 1e6 * run["inner.y"]
    print(
        f"{1e6 * clearance:.0f} µm of clearance:",
        f"the ring moves {y.max() - y.min():.2f} µm across the load",
    )
    axes.plot(
        x - x.mean(),
        y - y.mean(),
        style,
        label=f"{1e6 * clearance:.0f} µm",
        linewidth=1,
    )
axes.set(
    xlabel="along the load [µm]",
    ylabel="across the load [µm]",
    title="Path of the rotor about its mean place",
)
axes.legend(title="clearance")
plt.show()
