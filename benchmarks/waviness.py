"""What waviness costs a machine coupled two-way under a motor: ``python -m benchmarks.waviness``.

The toggle press, a six-bar with three such bearings, at constant speed and with a motor, each without waves, and with
two orders around each outer raceway and one around each inner one.  Prints the sentence of ``docs/theory/effects.md``
and keeps the numbers in ``benchmarks/results/waviness.json``; takes two minutes.
"""

from __future__ import annotations

import json
import sys
from functools import partial
from pathlib import Path
from typing import Any

from ballpass.derive import generate, read_scene
from ballpass.derive.features import count_operations
from ballpass.runtime import load
from ballpass.runtime.model import Model
from benchmarks.problem import BUILD, ROOT
from benchmarks.timing import interleave, spread

RESULTS = ROOT / "benchmarks" / "results" / "waviness.json"

#: A turn takes about a second; the press settles at nearly this speed.
MOTOR = """
[mechanism.driver.torque]
law = "asynchronous"
breakdown_torque = "600 N*m"
breakdown_slip = 0.3
synchronous_speed = "63 rpm"

[mechanism.driver.flywheel]
inertia = "20 kg*m^2"
"""

BEARINGS = ("pivot", "knee", "wrist")

#: Orders beside the eight balls push the rings, the others do not.
WAVES = {"outer": (7, 9), "inner": (9,)}
AMPLITUDE = "0.1 um"


def scenes() -> dict[str, str]:
    """Texts of the four scenes by their names."""
    steady = (ROOT / "scenes" / "toggle_press.toml").read_text(encoding="utf-8")
    after = 'start_angle = "180 deg"                 # the knee is bent most, the ram is up\n'
    assert after in steady
    waves = "".join(
        f"\n[bearings.{name}.{ring}_waviness]\n" + "".join(f'{n} = {{ amplitude = "{AMPLITUDE}" }}\n' for n in orders)
        for name in BEARINGS
        for ring, orders in WAVES.items()
    )
    machines = {"constant": steady, "motor": steady.replace(after, after + MOTOR)}
    kinds = {"": "", "_wavy": waves}
    return {name + kind: text + more for name, text in machines.items() for kind, more in kinds.items()}


def measure(rounds: int) -> dict[str, Any]:
    """Time of a turn of each scene, ratios within a round, steps and operations."""
    models: dict[str, Model] = {}
    operations = {}
    folder = BUILD / "generated" / "waviness"
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in scenes().items():
        path = folder / f"{name}.toml"
        path.write_text(text, encoding="utf-8")
        scene = read_scene(path)
        operations[name] = count_operations(scene)["rhs"]
        models[name] = load(generate(scene, folder / name))

    def turn(model: Model) -> Any:
        return model.simulate(cycles=1, transient=0, outputs=[], samples_per_cycle=2).statistics

    steps = {name: turn(model).steps for name, model in models.items()}
    times = interleave([partial(turn, model) for model in models.values()], rounds)
    seconds = dict(zip(models, times.T, strict=True))
    found: dict[str, Any] = {"steps": steps, "operations": operations}
    for name in ("constant", "motor"):
        plain, wavy = seconds[name], seconds[f"{name}_wavy"]
        found[name] = {"plain": spread(plain), "wavy": spread(wavy), "ratio": spread(wavy / plain)}
    return found


def sentence(found: dict[str, Any]) -> str:
    """What the page says."""

    def times(name: str) -> str:
        middle, low, high = found[name]["ratio"]
        return f"{middle:.2f} ({low:.2f} … {high:.2f})"

    steps = found["steps"]["motor_wavy"] / found["steps"]["motor"]
    plain, wavy = (1e3 * found["motor"][kind][0] for kind in ("plain", "wavy"))
    return (
        f"With the motor a turn takes {times('motor')} times as long with waves as without "
        f"({wavy:.3g} ms, {plain:.3g} ms; {steps:.2f} times the steps), at constant speed {times('constant')} times."
    )


def main() -> None:
    """Measure, keep and print."""
    found = measure(int(sys.argv[1]) if sys.argv[1:] else 15)
    Path(RESULTS).write_text(json.dumps(found, separators=(",", ":")) + "\n", encoding="utf-8")
    print(sentence(found))


if __name__ == "__main__":
    main()
