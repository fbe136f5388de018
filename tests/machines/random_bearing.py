"""Random bearings on a shaft: law, load, window, spall, clearance, speed, and a run of a few turns.

In: a seed.  Out: the text of a scene.
"""

from __future__ import annotations

import numpy as np

_LAWS = (
    'law = "none"',
    'law = "tangent"\nratio = "{0} s"',
    'law = "one-sided"\ncoefficient = "{1} N*s/m"',
    'law = "one-sided-gated"\ncoefficient = "{1} N*s/m"',
    'law = "two-sided-gated"\ncoefficient = "{1} N*s/m"',
    'law = "hunt-crossley"\nrestitution = {2}\nimpact_speed = "0.3 m/s"',
)


def random_bearing(seed: int) -> str:
    """Of a deep groove bearing whose shaft carries a constant load, all the time or in a window."""
    rng = np.random.default_rng([seed, 45])
    balls = int(rng.integers(7, 12))
    law = str(rng.choice(_LAWS)).format(
        *(float(f"{value:.4g}") for value in (10.0 ** rng.uniform(-6.2, -5), 10.0 ** rng.uniform(2, 3.3))),
        float(f"{rng.uniform(0.3, 0.8):.4g}"),
    )
    load, angle = 10.0 ** rng.uniform(1.5, 3), rng.uniform(-3, 3)
    speed = rng.uniform(60, 400)
    window, spall = "", ""
    if rng.random() < 0.5:
        begin, end = np.sort(rng.uniform(0, 12 / speed, 2))
        window = f'time_window = {{ start = "{begin:.7g} s", end = "{end:.7g} s" }}'
    if rng.random() < 0.5:
        spall = f"""
[bearing.defects.spall]
on = "ball"
profile = "half-sine"
angle = "{rng.uniform(0, 6):.7g} rad"
chord = "{rng.uniform(3e-4, 8e-4):.7g} m"
ball = {int(rng.integers(1, balls + 1))}
depth = "{rng.uniform(2e-6, 1e-5):.7g} m"
"""
    return f"""title = "random bearing {seed}"

[shaft]
speed = "{speed:.7g} rad/s"

[loads.load]
type = "constant"
force = ["{load * np.cos(angle):.7g} N", "{load * np.sin(angle):.7g} N"]
{window}

[bearing]
balls = {balls}
ball_diameter = "0.0079 m"
pitch_diameter = "{rng.uniform(0.033, 0.04):.7g} m"
clearance = "{rng.uniform(0, 2.5e-5):.7g} m"

[bearing.contact]
stiffness = "{10.0 ** rng.uniform(9.8, 10.2):.7g} N/m^1.5"

[bearing.damping]
{law}

[bearing.outer_ring]
support = "fixed"

[bearing.inner_ring]
mass = "{rng.uniform(0.5, 5):.7g} kg"
damping = "{rng.uniform(50, 400):.7g} N*s/m"
{spall}
[run]
transient_cycles = {float(rng.choice([0.0, 0.25]))}
cycles = {rng.uniform(0.6, 1.5):.4g}
outputs = ["ball.force", "load.x", "load.y", "ring_force.x", "ring_force.y"]
"""
