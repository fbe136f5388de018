"""What questions cost over the runs they are made of: gradients, optima, exponents; returns of a map beside DOP853."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ballpass.derive import generate, read_scene
from ballpass.runtime import QuantityFunction, load
from ballpass.runtime.motion.motion_map import MotionMap
from benchmarks.contenders import UnavailableError
from benchmarks.peers import imported
from benchmarks.problem import CASES, ROOT
from benchmarks.timing import interleave, spread

#: Rows of a batch of gradients, and values of a sweep, which an optimum begins with.
ROWS, SWEPT = 64, 33
FORCE, CLEARANCE = "peak_ball_force", "bearing.clearance"
#: The rotor of varying compliance: bounds of clearance and speed, values of each; readings that do not count, that do.
SPEEDS, CLEARANCES, POINTS = (80.0, 160.0), (0.0, 20e-6), 16
SETTLING, READINGS = 40, 60
#: Tolerance of the readings, of both.
RTOL = 1e-8


def measure(rounds: int, points: int = POINTS) -> dict[str, Any]:
    """Ratios of processor time in one run, and returns per second of one core."""
    press = CASES[1].model()
    function = QuantityFunction(press, FORCE, CLEARANCE, cycles=3)
    rows = press.parameters[CLEARANCE] * np.linspace(0.8, 1.2, ROWS)[:, None]
    with tempfile.TemporaryDirectory() as folder:
        rotor = load(generate(read_scene(ROOT / "scenes" / "varying_compliance.toml"), Path(folder)))
        pairs: dict[str, tuple[Callable[[], object], Callable[[], object]]] = {
            f"{ROWS} gradients by one parameter over {ROWS} values": (
                lambda: function.jacobian(rows),
                lambda: function(rows),
            ),
            f"optimum of one number over a sweep of {SWEPT} values": (
                lambda: press.optimize(FORCE, f"{CLEARANCE}=5 um:40 um", starts=1, progress=False),
                lambda: press.simulate_many({CLEARANCE: np.linspace(5e-6, 40e-6, SWEPT)}, FORCE),
            ),
            "bifurcation with exponents over one without": (
                lambda: rotor.bifurcation(f"{CLEARANCE}=0 um:20 um:8", progress=False),
                lambda: rotor.bifurcation(f"{CLEARANCE}=0 um:20 um:8", exponent=False, progress=False),
            ),
        }
        ratios = {}
        for words, (asked, beside) in pairs.items():
            asked(), beside()  # compiles
            times = interleave([asked, beside], rounds)
            ratios[words] = spread(times[:, 0] / times[:, 1])
        ranges = [
            f"{CLEARANCE}={CLEARANCES[0]} m:{CLEARANCES[1]} m:{points}",
            f"shaft.speed={SPEEDS[0]} rad/s:{SPEEDS[1]} rad/s:{points}",
        ]
        returns = {}
        for words, exponents in (("states alone", False), ("with exponents", True)):
            found = rotor.bifurcation(
                ranges, readings=READINGS, settling=SETTLING, exponent=exponents, rtol=RTOL, progress=False
            )
            assert isinstance(found, MotionMap)
            returns[words] = float(found.motions.returns[0] / found.motions.returns[1])
        try:
            returns["numbalsoda DOP853"] = _peer(rotor.parameters, points)
        except UnavailableError as fault:
            returns[f"numbalsoda DOP853 {fault}"] = math.nan
    return {"ratios": ratios, "points": points, "rtol": RTOL, "returns": returns}


def _peer(numbers: Mapping[str, float], points: int) -> float:
    """Returns of the rotor per second, states at a passing of balls after the other."""
    numba, numbalsoda = imported("numba"), imported("numbalsoda")

    @numba.cfunc(numbalsoda.lsoda_sig)
    def rate(t, z, dz, data):  # type: ignore[no-untyped-def]
        cage, gap, stiffness, mass, damping, load = numba.carray(data, (6,))
        x, y, vx, vy = numba.carray(z, (4,))
        out = numba.carray(dz, (4,))
        fx, fy = load * 1e6 - damping * vx, -damping * vy
        for k in range(8):
            angle = cage * t + 2.0 * math.pi * k / 8
            c, s = math.cos(angle), math.sin(angle)
            deflection = (x * c + y * s) * 1e-6 - gap
            if deflection > 0.0:
                force = 1e6 * stiffness * deflection**1.5
                fx -= force * c
                fy -= force * s
        out[0], out[1], out[2], out[3] = vx, vy, fx / mass, fy / mass

    address, solve = rate.address, numbalsoda.dop853

    @numba.njit
    def strobe(data, times):  # type: ignore[no-untyped-def]
        found, success = solve(address, np.array([4.0, 0.1, 0.0, 0.0]), times, data, RTOL, RTOL, 10_000_000)
        return found, success

    ratio = 0.5 * (1.0 - numbers["bearing.ball_diameter"] / numbers["bearing.pitch_diameter"])
    stiffness, mass = numbers["bearing.contact.stiffness"], numbers["bearing.inner_ring.mass"]
    spent, returns = 0.0, 0
    for clearance in np.linspace(*CLEARANCES, points):
        for speed in np.linspace(*SPEEDS, points):
            cage = ratio * speed
            data = np.array([cage, clearance / 2, stiffness, mass, numbers["bearing.inner_ring.damping"], 196.0])
            times = np.arange(SETTLING + READINGS + 1) * (2.0 * math.pi / 8 / cage)
            if not returns:
                strobe(data, times)  # compiles
            begun = time.process_time()
            _, success = strobe(data, times)
            spent += time.process_time() - begun
            if not success:
                raise RuntimeError(f"DOP853 failed at {clearance} m, {speed} rad/s")
            returns += len(times) - 1
    return returns / spent
