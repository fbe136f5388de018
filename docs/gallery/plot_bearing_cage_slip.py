"""
A cage that slips
=================

Measured lines seldom stand where the tables put them: a cage lags behind rolling by a
part of a percent to some percent. The slip is a number of the scene. BPFO falls by its
share, and BPFI rises by what BPFO lost.
"""

# %%
# The spalled rotor of :ref:`sphx_glr_auto_gallery_plot_bearing_outer_spall.py`: the
# slip changes no code.
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load
from ballpass.runtime.quantity.characteristic import characteristic_lines
from ballpass.runtime.vibration.diagnosis import envelope
from ballpass.runtime.vibration.spectrum import amplitude_spectrum

SPALL = """
[bearing.defects.spall]
on = "outer"
angle = "270 deg"
chord = "1 mm"
profile = "half-sine"
depth = "5 um"

[bearing.cage]
slip = 0.0
"""
Path("generated").mkdir(exist_ok=True)
scene = Path("generated/spalled_rotor.toml")
scene.write_text(shipped_scenes()["rotor"].read_text() + SPALL)
model = load(generate(scene))

# %%
# Three slips, three places of the highest line.
figure, axes = plt.subplots(figsize=(8, 3.4), layout="constrained")
for slip, style in ((0.0, "-"), (0.01, "--"), (0.03, ":")):
    numbers = {
        "bearing.cage.slip": slip,
        "loads.weight.force.y": -1000.0,
        "bearing.clearance": 10e-6,
    }
    run = model.simulate(
        duration=1.4, sample_rate=25600.0, outputs=["inner.ay"], parameters=numbers
    ).steady()
    over = envelope(run.t, run["inner.ay"], (2000.0, 10000.0))
    found = amplitude_spectrum(run.t, over - over.mean(), window="hann")
    near = np.abs(found.frequency - 150) < 8
    place = found.frequency[near][found.amplitude[near].argmax()]
    line = {
        each.label: each.frequency
        for each in characteristic_lines(model.manifest, model.numbers(numbers).values)
    }
    print(
        f"slip {slip:.0%}: line at {place:.1f} Hz;",
        f"BPFO {line['BPFO']:.1f} Hz, BPFI {line['BPFI']:.1f} Hz",
    )
    axes.plot(found.frequency[near], found.amplitude[near], style, label=f"{slip:.0%}")
axes.set(
    xlabel="frequency [Hz]",
    ylabel="amplitude [m/s²]",
    title="The line of the spall moves with the cage",
)
axes.legend(title="slip")
plt.show()
