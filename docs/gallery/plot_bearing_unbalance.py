"""
Unbalanced rotor, over speed
============================

A rotor of 5 kg in a preloaded 6204 with an unbalance of 0.1 g at 20 mm. A preloaded
bearing is a spring for small motion, so that a closed form exists for the circle that
the rotor runs on.

`Play with this machine <../live/rotor.html>`__ in its live page.
"""

# %%
# Forty speeds at once, in SIMD lanes. A negative clearance is preload.
import matplotlib.pyplot as plt
import numpy as np

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

model = load(generate(shipped_scenes()["rotor"]))
speed = np.linspace(2000, 40000, 40) * np.pi / 30
changed = {
    "bearing.clearance": -8e-6,
    "bearing.inner_ring.damping": 2000.0,
    "loads.unbalance.mass": 1e-4,
    "loads.weight.force.y": 0.0,
}
table = {"shaft.speed": speed} | {
    name: np.full(len(speed), value) for name, value in changed.items()
}
found = model.simulate_many(table, ["range:inner.x"], cycles=60, transient=40)
print(len(found.failures), "failures")

# %%
# The closed form: :math:`m e \omega^2 / |k - M \omega^2 + i c \omega|`, with the
# stiffness of the preloaded bearing.
small = model.linearize(parameters=changed)
k, mass, c = small.stiffness[0, 0], model.parameters["bearing.inner_ring.mass"], 2000.0
print(
    f"stiffness {k / 1e6:.1f} N/µm,",
    f"resonance at {np.sqrt(k / mass) * 30 / np.pi:.0f} rpm",
)
closed = 1e-4 * 20e-3 * speed**2 / np.abs(k - mass * speed**2 + 1j * c * speed)
radius = np.asarray(found["range:inner.x"]) / 2

rpm = speed * 30 / np.pi
figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
axes.plot(rpm, 1e6 * closed, label="closed form")
axes.plot(rpm, 1e6 * radius, "o", markersize=4, label="simulated")
axes.set(
    xlabel="speed [rpm]", ylabel="radius of the orbit [µm]", title="Unbalance response"
)
axes.legend()
plt.show()
print(f"largest difference {100 * np.max(np.abs(radius / closed - 1)):.1f} %")
