"""
Run the punching press
======================

The press of the paper: a crank-slider at 500 rpm, punched between 237° and 267°, whose
crank turns in a 6204 bearing.

`Play with this machine <../live/punching_press.html>`__ in its live page.
"""

# %%
# `generate` writes C code, `load` compiles it. Both are skipped where nothing changed.
import matplotlib.pyplot as plt

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

model = load(generate(shipped_scenes()["press"]))
solution = model.simulate(cycles=4, transient=2)

# %%
# Extremes are found in every step of the integration, not only at the samples.
force = solution.steady_reductions["ball.force"]
print(
    f"highest ball force {force.maximum:.0f} N,",
    f"on ball {force.maximum_ball}, at {force.maximum_time:.4f} s",
)

# %%
# The punch loads a ball for a few milliseconds. Which ball it is changes from turn to
# turn, for the cage turns more slowly than the crank.
steady = solution.steady()
time = 1e3 * (steady.t - steady.t[0])
figure, (all_turns, punch) = plt.subplots(
    1, 2, sharey=True, figsize=(9, 3.8), layout="constrained"
)
for number, forces in enumerate(steady["ball.force"].T, start=1):
    for axes in (all_turns, punch):
        axes.plot(time, forces / 1e3, label=f"ball {number}", linewidth=1.1)
all_turns.set(
    xlabel="time [ms]",
    ylabel="ball force [kN]",
    title="Ball forces in the last two turns",
)
punch.set(xlabel="time [ms]", xlim=(76, 96), title="Under the punch")
punch.legend(ncols=2, fontsize=8)
plt.show()
