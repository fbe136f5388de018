"""
Parameters from a measured signal
=================================

The displacement of a rotor was measured with noise, and it is not known when. How large
are clearance and unbalance?
"""

# %%
# A run with other parameters and noise stands for the measurement.
import matplotlib.pyplot as plt
import numpy as np

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

model = load(generate(shipped_scenes()["rotor"]))
truth = {"bearing.clearance": 7e-6, "loads.unbalance.mass": 4e-3}
run = model.simulate(duration=0.1, sample_rate=5e3, parameters=truth)
noise = 0.05 * np.std(run["inner.y"]) * np.random.default_rng(1).standard_normal(501)
late = (
    run.t >= 0.01
)  # the record begins 10 ms after the run, and its clock is 0.7 ms fast
measured = (run["inner.y"] + noise)[late]
data = {"time": run.t[late] - 0.01 + 0.7e-3, "inner.y": measured}

# %%
# Each parameter has bounds; the time of the data may be wrong by two milliseconds to
# either side.
vary = ["bearing.clearance=2 um:15 um", "loads.unbalance.mass=1 g:20 g:log"]
found = model.fit(data, vary, begin=0.01, shift="-2 ms:2 ms")
print(found)

# %%
# What is left must look like noise.
signal = found.signals[0]
left = signal.model - signal.measured
figure, (above, below) = plt.subplots(2, 1, sharex=True, layout="constrained")
above.plot(signal.t, 1e6 * signal.measured, ".", label="measured")
above.plot(signal.t, 1e6 * signal.model, label="model")
above.set_ylabel("inner ring, y [µm]")
above.legend()
below.plot(signal.t, left / signal.noise, ".")
below.set(xlabel="time of the data [s]", ylabel="difference over noise")
plt.show()
