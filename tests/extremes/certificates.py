"""Verdicts of sensitivity queries at random parameters, against differences of runs of the tests' own.

`.venv/bin/python tests/extremes/certificates.py` asks for 300 pairs, which takes a quarter of an hour, and says what
came of them; `test_certificates.py` asks for a few.
"""

from __future__ import annotations

import math
import tempfile
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from independent_runs import TURN, Derivative, differentiate

from ballpass.derive import generate
from ballpass.runtime import Model, load
from ballpass.runtime.certify.certificate import AGREEMENT, Verdict
from ballpass.runtime.certify.sensitivity_report import Sensitivity

SCENES = ("punching_press", "punching_press_tangent", "offset_slider", "four_bar", "varying_compliance")

#: Of each query: quantities, parameters; queries of each scene.
QUANTITIES, PARAMETERS, QUERIES = 6, 2, 5

#: What is drawn from: of all scenes, and of those with a mechanism.
OF = (
    *("peak_ball_force", "min:ball.force", "mean:ball.force", "rms:ball.elastic_force", "max:ball.force[3]"),
    *("mean:ball.elastic_force[1]", "rms:inner.y", "mean:inner.x", "range:inner.y", "min:inner.x", "end:inner.y"),
    *("amplitude:inner.y@2x", "rms:inner.vx"),
)
OF_MECHANISM = ("max:drive_torque", "rms:reaction.A.y")

#: Longest run [s], and most turns.
LONGEST, TURNS = 0.08, 1.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Query:
    """What is asked of a model."""

    parameters: Mapping[str, float]
    cycles: float
    of: tuple[str, ...]
    wrt: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A pair, and what the tests' own runs say of it."""

    scene: str
    pair: Sensitivity
    value: float
    truth: Derivative

    @property
    def known(self) -> bool:
        """Whether the reference is known better than what is asked of a certificate."""
        assert self.pair.check.quantum is not None
        return self.truth.uncertainty <= 0.25 * (AGREEMENT * abs(self.truth.value) + self.pair.check.quantum)

    @property
    def wrong(self) -> bool:
        """Whether the derivative is off by more than it states, 1e-3 of itself and what counts as nothing."""
        assert self.pair.uncertainty is not None
        return abs(self.pair.derivative - self.truth.value) > self.allowed + self.pair.uncertainty

    @property
    def allowed(self) -> float:
        """What may be between the derivative and that of the tests."""
        assert self.pair.check.quantum is not None
        return AGREEMENT * abs(self.truth.value) + self.pair.check.quantum + self.truth.uncertainty

    @property
    def outcome(self) -> str:
        """The verdict, and whether it is right; where the tests' own number is not known well, that alone."""
        verdict = self.pair.check.verdict
        if verdict is Verdict.NOT_CHECKED:
            return "not checked"
        if not self.known:
            return f"{verdict.value}, reference not known"
        right = self.wrong if verdict is Verdict.DISAGREES else not self.wrong
        return f"{verdict.value}, {'rightly' if right else 'wrongly'}"


def draw(model: Model, generator: np.random.Generator) -> Query:
    """Parameters some per cent from the scene's, any speed from 5 to 3000 rpm, a load that switches on in the run."""
    manifest = model.manifest
    mechanism = manifest.mechanism
    speed_name = mechanism.speed if mechanism is not None else "shaft.speed"
    parameters: dict[str, float] = {}
    for info in manifest.parameters:
        value, share = model.parameters[info.name], generator.uniform(-1.0, 1.0)
        if info.name.startswith("bearing.initial"):
            value += 0.5e-6 * share if info.unit == "m" else 0.0
        elif info.name.endswith("groove_radius"):
            value *= 1.005 + 0.005 * share
        elif info.name == "bearing.clearance":
            value = (10.0 + 8.0 * share) * (0.2 if mechanism is None else 1.0) * 1e-6
        elif info.unit == "rad":
            value += 0.02 * share
        elif info.name != "bearing.ball_diameter":
            value *= 0.95 + 0.05 * share
        parameters[info.name] = value
    speed = 10.0 ** generator.uniform(math.log10(5.0), math.log10(3000.0)) * TURN / 60.0
    cycles = min(TURNS, LONGEST * speed / TURN) * (1.0 if mechanism is not None else 2.0)
    parameters[speed_name] = speed
    windows = [edge for item in manifest.inputs for window in item.windows for edge in window]
    wanted = [speed_name, "bearing.clearance", *windows]
    if mechanism is not None:
        first = min(TURN * cycles, TURN) * generator.uniform(0.3, 0.6)
        parameters["mechanism.driver.start_angle"] = parameters[str(generator.choice(windows))] - first
        wanted.append("mechanism.driver.start_angle")
    others = [info.name for info in manifest.parameters if info.name not in wanted]
    pool = OF + (OF_MECHANISM if mechanism is not None else ())
    generator.uniform()  # of an option that is gone: each seed keeps its query
    return Query(
        parameters=parameters,
        cycles=cycles,
        of=tuple(map(str, generator.choice(pool, QUANTITIES, replace=False))),
        wrt=(str(generator.choice(wanted)), str(generator.choice(others))),
    )


def examine(model: Model, query: Query) -> list[Row]:
    """The tool's answer beside that of the tests' own runs."""
    transient = 0.25 * query.cycles
    report = model.sensitivity(
        query.of,
        query.wrt,
        query.cycles,
        transient=transient,
        parameters=query.parameters,
    )
    scales = {name: report[query.of[0], name].scale for name in query.wrt}
    values, found = differentiate(model, query.parameters, query.of, scales, query.cycles, transient)
    at = dict(zip(query.of, values.tolist(), strict=True))
    return [
        Row(
            scene=report.scene,
            pair=pair,
            value=at[pair.quantity],
            truth=found[pair.quantity, pair.parameter],
        )
        for pair in report.pairs
    ]


def main() -> None:
    """All queries, and how often each outcome came."""
    counts: Counter[str] = Counter()
    for place, scene in enumerate(SCENES):
        path = Path(__file__).resolve().parents[2] / "scenes" / f"{scene}.toml"
        with tempfile.TemporaryDirectory() as folder:
            model = load(generate(path, Path(folder) / scene))
            for number in range(QUERIES):
                for row in examine(model, draw(model, np.random.default_rng([place, number]))):
                    counts[row.outcome] += 1
                    if row.outcome not in ("verified, rightly", "disagrees, rightly"):
                        pair, truth = row.pair, row.truth
                        print(
                            f"{scene} {number}: d({pair.quantity})/d({pair.parameter}) {row.outcome}: "
                            f"{pair.derivative:.6g} ± {pair.uncertainty:.1g} by {pair.route}; "
                            f"reference {truth.value:.6g} ± {truth.uncertainty:.1g}",
                            flush=True,
                        )
    print(f"{sum(counts.values())} pairs: " + ", ".join(f"{count} {name}" for name, count in counts.most_common()))


if __name__ == "__main__":
    main()
