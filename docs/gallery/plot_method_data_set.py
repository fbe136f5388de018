"""
A data set and a classifier
===========================

Labelled signals of a healthy rotor, of one with a spall and of a loose one, made with
random speeds and noise. A random forest learns on one seed and is tested on another.
"""

# %%
# Three classes of one model: a spall of depth zero is none.
import shutil
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray
from sklearn.ensemble import RandomForestClassifier

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import Distribution, SignalClass, Signals, load, make_data_set
from ballpass.runtime.vibration.diagnosis import diagnosis, envelope

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


def between(low, high):
    return Distribution(name="uniform", arguments={"loc": low, "scale": high - low})


speed = {"shaft.speed": between(250, 370)}  # rad/s
numbers = {
    "healthy": {
        "bearing.clearance": between(2e-6, 8e-6),
        "bearing.defects.spall.depth": 0.0,
    },
    "spall": {
        "bearing.clearance": between(2e-6, 8e-6),
        "bearing.defects.spall.depth": between(3e-6, 10e-6),
    },
    "loose": {
        "bearing.clearance": between(30e-6, 50e-6),
        "bearing.defects.spall.depth": 0.0,
    },
}
classes = [
    SignalClass(label=name, model=model, members=20, parameters=speed | own)
    for name, own in numbers.items()
]
signals = Signals(
    outputs=("inner.ay",), sample_rate=25.6e3, duration=0.25, transient=0.1, snr=20.0
)


# %%
# Features: rms, kurtosis and crest factor of the signal and of its envelope.
def features(seed):
    folder = Path(f"generated/faults_{seed}.zarr")
    shutil.rmtree(folder, ignore_errors=True)
    make_data_set(folder, classes, signals, seed=seed)
    with xarray.open_zarr(folder, chunks=None) as data:
        t, label = data.time.values, data.label.values
        rows = []
        for signal in data["inner.ay"].values.astype(float):
            told, over = (
                diagnosis(signal),
                diagnosis(envelope(t, signal, (500.0, 10e3))),
            )
            rows.append(
                [
                    told.rms,
                    told.kurtosis,
                    told.crest_factor,
                    over.kurtosis,
                    over.crest_factor,
                ]
            )
    return np.array(rows), label


(seen, labels), (unseen, truth) = features(1), features(2)
forest = RandomForestClassifier(random_state=0).fit(seen, labels)
print(
    f"{forest.score(unseen, truth):.0%} of {len(truth)} unseen signals are named right"
)

figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for name, mark in zip(numbers, "os^", strict=True):
    axes.semilogx(
        unseen[truth == name, 0],
        unseen[truth == name, 1],
        mark,
        label=name,
        markersize=5,
    )
axes.set(xlabel="rms [m/s²]", ylabel="kurtosis", title="Signals of three classes")
axes.legend()
plt.show()
