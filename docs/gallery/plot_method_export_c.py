"""
The same press as a program in C
================================

`ballpass export` writes a folder with C sources and a Makefile. The program needs
neither Python nor ballpass. Here it runs beside the model it came from.
"""

# %%
# Write, build, run.
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

folder = generate(shipped_scenes()["press"])
program = Path("generated/punching_press_c")
ballpass = Path(sys.executable).with_name("ballpass")
subprocess.run(
    [ballpass, "export", folder, "--c", "--out", program],
    check=True,
)
subprocess.run(["make", "-s", "-C", program], check=True)
printed = subprocess.run(
    [program / "punching_press", "--cycles", "2"],
    capture_output=True,
    text=True,
    check=True,
).stdout
table = np.genfromtxt(printed.splitlines(), delimiter=",", names=True, deletechars="")
print(len(table), "rows of", len(table.dtype.names), "columns")

# %%
# Both give the same motion.
model = load(folder)
python = model.simulate(cycles=2, transient=0, method="stepper")
difference = (
    np.abs(table["inner.y"] - python["inner.y"]).max() / np.abs(python["inner.y"]).max()
)
print(f"largest difference of y, relative: {difference:.0e}")

figure, axes = plt.subplots(figsize=(8, 3.4), layout="constrained")
axes.plot(1e3 * python.t, 1e6 * python["inner.y"], label="Python")
axes.plot(
    1e3 * table["t"][::25], 1e6 * table["inner.y"][::25], ".", label="program in C"
)
axes.set(
    xlabel="time [ms]",
    ylabel="y of the inner ring [µm]",
    title="Two turns of the press",
)
axes.legend()
plt.show()
