"""What the paper's one-way model leaves out on its press: laws and housings, one-way beside two-way.

    python -m benchmarks.trade.coupling

Writes docs/howto/two_way_numbers.md.  Ten steady turns of each: the mean of the highest ball force of each turn, rms of
the inner ring's motion along the guide and of its speed.  `ballpass trade SCENE --against one-way` measures another
scene.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, load
from benchmarks.trade.promise import ROOT

PAGE = ROOT / "docs" / "howto" / "two_way_numbers.md"
SCENES = ("punching_press", "punching_press_two_way")

#: Names of law and housing, and the changes of the scenes' text for them.
LAWS = {
    "`one-sided`, 683 N·s/m": (),
    "`tangent`, 2.5e-5 s": (
        ('law = "one-sided"', 'law = "tangent"'),
        ('ratio = "0.25e-5 s*mm^0.5"', 'ratio = "2.5e-5 s"'),
    ),
}
HOUSINGS = {
    "elastic": (),
    "fixed": (
        ('support = "elastic"\nmass', 'support = "fixed"\n#mass'),
        ('stiffness = "5e7 N/m"', "#"),
        ('damping = "500 N*s/m"', "#"),
        ('outer = ["0 um", "0 um"]\nouter_velocity = ["0 m/s", "0 m/s"]', ""),
        ('"outer.*", ', ""),
    ),
}

#: Turns that count, and those before them.
TURNS, TRANSIENT = 10, 2


def cases() -> Iterator[tuple[str, str]]:
    """Law and housing of each row."""
    yield from ((law, housing) for law in LAWS for housing in HOUSINGS)


def model_of(scene: str, law: str, housing: str, folder: Path) -> Model:
    """The press with this law and housing, generated in `folder`."""
    text = (ROOT / "scenes" / f"{scene}.toml").read_text(encoding="utf-8")
    for old, new in (*LAWS[law], *HOUSINGS[housing]):
        assert old in text, f"{old!r} is not in {scene}"
        text = text.replace(old, new)
    return load(generate(scene_from_text(text, scene), folder))


def measure(model: Model) -> tuple[float, float, float]:
    """Mean over the turns of the highest ball force [N], rms of y [m] and of its speed [m/s]."""
    outputs = ["inner.y", "inner.vy", "ball.force"]
    run = model.simulate(TRANSIENT, rtol=1e-8, samples_per_cycle=20000, outputs=outputs, transient=0)
    peaks, squares = [], []
    for _ in range(TURNS):
        run = model.simulate(1, rtol=1e-8, samples_per_cycle=20000, outputs=outputs, transient=0, initial=run.end)
        assert run.reductions is not None
        peaks.append(run.reductions["ball.force"].maximum)
        squares.append([run.reductions[name].rms ** 2 for name in outputs[:2]])
    y, speed = np.sqrt(np.mean(squares, axis=0)).tolist()
    return float(np.mean(peaks)), y, speed


def row(law: str, housing: str, folder: Path) -> str:
    """A line of the table."""
    (force, y, v), (forces, ys, vs) = (measure(model_of(name, law, housing, folder / name)) for name in SCENES)
    numbers = (
        f"{force:.0f} \\| {forces:.0f}",
        f"{1e6 * y:.1f} \\| {1e6 * ys:.1f}",
        f"{1e3 * v:.1f} \\| {1e3 * vs:.1f}",
    )
    return f"| {law} | {housing} | {' | '.join(numbers)} |"


def main() -> None:
    head = (
        "| law | housing | peak ball force [N] | rms of y [µm] | rms of the speed along y [mm/s] |",
        "| --- | --- | ---: | ---: | ---: |",
    )
    lines = []
    for k, case in enumerate(cases()):
        with tempfile.TemporaryDirectory() as folder:
            lines.append(row(*case, Path(folder) / str(k)))
    PAGE.write_text("\n".join((*head, *lines)) + "\n", encoding="utf-8", newline="\n")
    print(PAGE)


if __name__ == "__main__":
    main()
