r"""
Eq. (1) from the geometry
=========================

The paper prints Eq. (1), linear equations for the joint reactions and the drive torque,
without saying how they came about. Here they are derived from the bodies and joints of
the scene file.
"""

# %%
# Derive the equations. The result is SymPy; nothing is compiled.
import matplotlib.pyplot as plt
import numpy as np

from ballpass.derive import derive, generate, read_scene, shipped_scenes
from ballpass.runtime import load

system = derive(read_scene(shipped_scenes()["press"]))
equations = system.reactions
print(len(equations.unknowns), "unknowns:", *equations.unknowns[:5])
print(*equations.unknowns[5:])

# %%
# Each row is a balance of a body. Most entries are zero, which is why a closed-form
# solution exists.
body_of_row = [f"{body} {balance}" for body, balance in equations.rows]
filled = np.array(equations.matrix.applyfunc(lambda entry: int(entry != 0))).astype(int)
print(filled.sum(), "of", filled.size, "entries differ from zero")

# %%
# Generated and run, the same equations give the reactions over a turn. The work of the
# drive must equal the work against the punch: force times the way of the slider within
# the window.
model = load(generate(shipped_scenes()["press"]))
turn = model.simulate(
    cycles=1, transient=0, outputs=["reaction.A.x", "reaction.A.y", "drive_torque"]
)
angle = model.parameters["mechanism.driver.speed"] * turn.t
work = np.trapezoid(turn["drive_torque"], angle)
print(f"work of the drive in a turn: {work:.2f} J")

figure, (left, right) = plt.subplots(1, 2, figsize=(9.5, 4.6), layout="constrained")
left.imshow(filled, cmap="Greys", aspect="auto")
left.set_yticks(range(len(body_of_row)), body_of_row)
left.set_xticks(
    range(len(equations.unknowns)), [str(u) for u in equations.unknowns], rotation=90
)
left.set_title("Entries of Eq. (1)")
right.plot(np.degrees(angle), turn["reaction.A.y"] / 1e3, label="y")
right.plot(np.degrees(angle), turn["reaction.A.x"] / 1e3, "--", label="x")
right.set(
    xlabel="crank angle [°]",
    ylabel="force [kN]",
    title="Force of the crank on the frame",
)
right.legend()
plt.show()
