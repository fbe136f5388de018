"""
Which tolerance matters
=======================

Three tolerances of a rotor in a ball bearing: which of them makes the largest ball
force vary, and how many machines keep a limit?
"""

# %%
# The clearance scatters as mounted bearings do, the unbalance within its grade, and the
# damping is hardly known.
import matplotlib.pyplot as plt
import numpy as np

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

model = load(generate(shipped_scenes()["rotor"]))
vary = [
    "bearing.clearance=norm:loc=5 um:scale=1 um",
    "loads.unbalance.mass=3 g:7 g",
    "bearing.inner_ring.damping=300 N*s/m:800 N*s/m",
]
limit = "peak_ball_force <= 52 N"
found = model.sobol(vary, "peak_ball_force", limit=limit, samples=256)
print(found)

# %%
# A total share near zero says that this tolerance may be as wide as it is. Where total
# shares exceed first-order ones, tolerances act together.
peak = found.quantities[0]
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
place = np.arange(len(found.inputs))
left.barh(place + 0.2, [share.total for share in peak.shares], 0.36, label="total")
left.barh(
    place - 0.2, [share.first for share in peak.shares], 0.36, label="first order"
)
left.set_yticks(place, found.inputs)
left.set_xlabel("share in the variance")
left.legend()
right.hist(found.values[:, 0], bins=30)
right.set(xlabel="peak ball force [N]", ylabel="members")
plt.show()
