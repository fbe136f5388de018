"""
Spectrum of a spall on the outer raceway
========================================

Each ball that rolls over the spall excites the bearing. The envelope of the vibration
shows how often: at the ball-pass frequency of the outer ring, BPFO, and its multiples.
"""

# %%
# The scene of the rotor, with a spall in the loaded zone.
from pathlib import Path

import matplotlib.pyplot as plt

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load
from ballpass.runtime.quantity.characteristic import characteristic_lines
from ballpass.runtime.vibration.diagnosis import diagnosis, envelope
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
# A second of signal, as an accelerometer samples it.
loaded = {"loads.weight.force.y": -1000.0, "bearing.clearance": 10e-6}
run = model.simulate(
    duration=1.4, sample_rate=25600.0, outputs=["inner.ay"], parameters=loaded
).steady()
print(f"kurtosis {diagnosis(run['inner.ay']).kurtosis:.1f}")
over = envelope(run.t, run["inner.ay"], (2000.0, 10000.0))
spectrum = amplitude_spectrum(run.t, over - over.mean(), window="hann")

# %%
# The lines come from the speeds of the model's own cage.
lines = {
    line.label: line.frequency
    for line in characteristic_lines(model.manifest, model.numbers(loaded).values)
}
highest = spectrum.frequency[spectrum.amplitude.argmax()]
print(f"highest line {highest:.1f} Hz; BPFO is {lines['BPFO']:.1f} Hz")

figure, axes = plt.subplots(figsize=(8, 3.4), layout="constrained")
axes.plot(spectrum.frequency, spectrum.amplitude, linewidth=1)
for k in range(1, 5):
    axes.axvline(k * lines["BPFO"], color="grey", linestyle=":", linewidth=1)
axes.set(
    xlim=(0, 700),
    xlabel="frequency [Hz]",
    ylabel="amplitude [m/s²]",
    title="Envelope spectrum; dotted: k BPFO",
)
plt.show()
