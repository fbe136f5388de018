"""
Pictures of a run in one line each
==================================

`solution.plot` draws the usual pictures on axes of matplotlib: orbits, spectra, ball
loads, and any output over time.
"""

# %%
# Without axes each call makes a figure of its own; with `ax` it draws into yours.
import matplotlib.pyplot as plt

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

model = load(generate(shipped_scenes()["press"]))
solution = model.simulate(cycles=8, transient=2)

figure, axes = plt.subplots(2, 2, figsize=(9.5, 7), layout="constrained")
solution.plot.orbit(ax=axes[0, 0])
solution.plot.orbit(relative=True, ax=axes[0, 1])
solution.plot.spectrum("inner.y", ax=axes[1, 0])
solution.plot.outputs("reaction.A.x", "reaction.A.y", ax=axes[1, 1])
axes[0, 0].set_title("Orbit")
axes[0, 1].set_title("Inner against outer ring")
plt.show()

# %%
# Most of the orbit is motion of both rings together, on the elastic housing. The rest
# is motion of the inner ring against the outer one.
steady = solution.steady()
apart = steady["inner.y"] - steady["outer.y"]
whole = steady["inner.y"].max() - steady["inner.y"].min()
print(f"{1e6 * whole:.0f} µm, of which {1e6 * (apart.max() - apart.min()):.0f} µm")
