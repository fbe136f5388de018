"""
One-way or two-way coupling
===========================

The paper computes the reaction of an ideal linkage and loads the bearing with it: one
way. In the machine the bearing's play moves the linkage as well. The same press, both
ways.

`Play with this machine <../live/punching_press_two_way.html>`__ in its live page.
"""

# %%
# Two scenes, two models. The second one has the bearing as a joint with play.
import matplotlib.pyplot as plt

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

scenes = {"one-way": "press", "two-way": "punching-press-two-way"}
models = {
    name: load(generate(shipped_scenes()[scene])) for name, scene in scenes.items()
}

# %%
# In the two-way model the mass that moves in the clearance is that of the linkage, and
# not that of ring and pin alone.
for name, model in models.items():
    peak = model.reduce(cycles=12, transient=2)["ball.force"].maximum
    along = model.linearize().mass[1, 1] / (2 if name == "two-way" else 1)
    print(
        f"{name}: highest ball force {peak:.0f} N,",
        f"moving mass {along:.2f} kg for each bearing",
    )

# %%
# The one-way ring vibrates quickly, the two-way ring slowly.
figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
for (name, model), style in zip(models.items(), ("-", "--"), strict=True):
    run = model.simulate(cycles=4, transient=3).steady()
    axes.plot(1e3 * (run.t - run.t[0]), 1e3 * run["inner.vy"], style, label=name)
axes.set(
    xlabel="time [ms]",
    ylabel="speed along y [mm/s]",
    title="Inner ring in the fourth turn",
)
axes.legend()
plt.show()
