"""
What accuracy costs
===================

Name the error of the result, and the tool chooses method and tolerance. It runs twice,
compares, and says how large the error is.
"""

# %%
# The same question with smaller and smaller targets; the truth is a run at a tolerance
# of 1e-12.
import matplotlib.pyplot as plt

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

model = load(generate(shipped_scenes()["press"]))
truth = model.reduce(cycles=4, rtol=1e-12, kinks="located")["ball.force"].maximum
targets = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6]
runs = [
    model.simulate(error=target, of="peak_ball_force", cycles=4) for target in targets
]

# %%
# Each estimate is within its target, and so is the true error.
errors = [abs(run.steady_reductions["ball.force"].maximum / truth - 1) for run in runs]
estimates = [run.accuracy.estimate for run in runs]
for target, run, error in zip(targets, runs, errors, strict=True):
    print(
        f"target {target:.0e}: estimate {run.accuracy.estimate:.1e},",
        f"true {error:.1e}, {run.statistics.steps} steps",
    )

figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
steps = [run.statistics.steps for run in runs]
axes.loglog(steps, targets, "k_", markersize=16, label="target")
axes.loglog(steps, estimates, "s", label="estimate")
axes.loglog(steps, errors, "o", label="true error")
axes.set(
    xlabel="steps of the run",
    ylabel="relative error of the peak ball force",
    title="Accuracy against work",
)
axes.legend()
plt.show()
