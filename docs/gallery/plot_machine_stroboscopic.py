"""
Does the press repeat itself?
=============================

Look at the inner ring once in a turn, always at the same crank angle. Equal points mean
that the motion repeats. Here the balls stand elsewhere each time, so that the points
wander along a curve.
"""

# %%
# Two hundred turns after the transient, and one more with fine steps.
import matplotlib.pyplot as plt

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load
from ballpass.runtime.ask.observables import stroboscopic_points

model = load(generate(shipped_scenes()["press"]))
run = model.simulate(
    cycles=220, transient=20, samples_per_cycle=1000, outputs=["inner.y"]
)
solution = run.steady()
one_more = model.simulate(
    cycles=1, transient=0, samples_per_cycle=10000, initial=run.end
)

# %%
# The cage makes a whole number of ball distances in 134 turns of the crank, nearly:
# then the motion comes back.
points = stroboscopic_points(
    solution.t,
    solution["inner.y"],
    solution["inner.vy"],
    cycle_length=model.period(),
    offset=0.75 * model.period(),
)
print(len(points.time), "points")
print(f"they span {1e6 * (points.position.max() - points.position.min()):.2f} µm")

figure, (path, strobe) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
path.plot(1e6 * one_more["inner.x"], 1e6 * one_more["inner.y"], linewidth=0.7)
path.set(xlabel="x [µm]", ylabel="y [µm]", title="Orbit of the inner ring, one turn")
strobe.plot(1e6 * points.position, 1e3 * points.velocity, ".", markersize=4)
strobe.set(
    xlabel="y [µm]", ylabel="speed along y [mm/s]", title="Once in a turn, at 270°"
)
plt.show()
