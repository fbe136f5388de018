"""
Where the largest ball force is least
=====================================

How much damping should the housing of the press have? The largest ball force is the
largest of many maxima, and has its least value where two of them are equal: at a kink.
"""

# %%
# The search takes exact slopes, and says so where it ends at a kink.
import matplotlib.pyplot as plt
import numpy as np

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

model = load(generate(shipped_scenes()["press"]))
damping, turns = "bearing.outer_ring.damping", {"cycles": 4, "transient": 2}
vary = f"{damping}=1000 N*s/m:10000 N*s/m:log"
found = model.optimize("peak_ball_force", vary, starts=1, **turns)
print(found)

# %%
# A sweep shows the same: left and right of the kink other balls, or the same ball at
# another time, carry the largest force.
values = np.geomspace(1e3, 1e4, 121)
swept = model.simulate_many({damping: values}, "peak_ball_force", **turns)
figure, axes = plt.subplots(figsize=(8, 3.5), layout="constrained")
axes.semilogx(values, swept["peak_ball_force"], label="sweep")
axes.plot(found.x[0], found.value, "o", color="tab:red", label="found by the search")
axes.set(xlabel="damping of the housing [N·s/m]", ylabel="largest ball force [N]")
axes.legend(loc="upper center")
plt.show()
