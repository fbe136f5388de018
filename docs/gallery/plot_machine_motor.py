"""
A motor with a flywheel
=======================

A crank that turns at constant speed needs a drive that gives any torque. Here an
asynchronous motor turns the press: the punch slows the flywheel down, and the motor
brings it back in the rest of the turn.

`Play with this machine <../live/punching_press_motor.html>`__ in its live page.
"""

# %%
# The speed is a state of this scene. It needs some turns to settle.
import matplotlib.pyplot as plt
import numpy as np

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import load

model = load(generate(shipped_scenes()["punching-press-motor"]))

# %%
# The inertia of the flywheel is a number: three flywheels, one model. The range of the
# speed shrinks as it grows.
figure, (speeds, torques) = plt.subplots(
    2, 1, sharex=True, figsize=(8, 5), layout="constrained"
)
for inertia, style in ((0.05, ":"), (0.1, "-"), (0.3, "--")):
    run = model.simulate(
        cycles=10,
        transient=8,
        parameters={"mechanism.driver.flywheel.inertia": inertia},
        samples_per_cycle=400,
    ).steady()
    rpm = run["driver.speed"] * 30 / np.pi
    turned = (run["driver.angle"] - run["driver.angle"][0]) / (2 * np.pi)
    print(f"{inertia} kg m²: {rpm.min():.0f} to {rpm.max():.0f} rpm")
    speeds.plot(turned, rpm, style, label=f"{inertia} kg m²")
    torques.plot(turned, run["drive_torque"], style)
speeds.set(ylabel="speed [rpm]", title="Speed and torque of the motor")
speeds.legend(title="flywheel", loc="lower right")
torques.set(xlabel="turns of the crank", ylabel="torque [N m]")
plt.show()
