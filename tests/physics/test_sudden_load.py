"""A load that comes suddenly, against the closed form of a mass on a Hertz contact."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ballpass.runtime import Model

CONSTANT = (
    'type = "constant"                       # or "harmonic" (mean, amplitude, frequency, phase), or "table" '
    '(time, x, y)\nforce = ["196 N", "0 N"]                # the weight of 20 kg; x points along gravity here'
)

#: The load jumps from 10 N to 1000 N within a hundredth of a natural period.
STEP = """type = "table"
time = ["0 s", "0.1 s", "0.10002 s", "1 s"]
x = ["10 N", "10 N", "1000 N", "1000 N"]
y = ["0 N", "0 N", "0 N", "0 N"]"""

RUN = "cycles = 24                             # turns of the shaft, 0.153 s each\ntransient_cycles = 20 "
START = ('inner = ["3.9937 um", "0.1 um"]', 'inner = ["0.55 um", "0 um"]')


def test_a_sudden_load_makes_almost_two_and_a_half_times_the_static_force(make_model: Callable[..., Model]) -> None:
    """A mass on a Hertz contact: work F d = 2/5 k d^2.5, hence d = 2.5^(2/3) of the static one, the force 2.5 times."""
    model = make_model("varying_compliance", (CONSTANT, STEP), (RUN, "cycles = 1\ntransient_cycles = 0 "), START)
    moving = model.reduce(method="stepper", rtol=1e-8)["ball.force"]
    still = model.static_equilibrium(moving.maximum_time, load=(1000.0, 0.0)).peak_ball_force
    # from 10 N on: 0.4 (z^2.5 - z0^2.5) = z - z0, z0 = 0.01^(2/3); the balls move on meanwhile, and damping takes some
    z0 = 0.01 ** (2.0 / 3.0)
    roots = np.linspace(1.5, 2.0, 100_001)
    z = roots[np.argmin(np.abs(0.4 * (roots**2.5 - z0**2.5) - (roots - z0)))]
    assert moving.maximum / still == pytest.approx(z**1.5, rel=0.03)
