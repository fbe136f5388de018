"""Make the pictures of README and documentation anew: ``.venv/bin/python docs/make_figures.py``.

Every picture is a figure of ``ballpass run SCENE`` or ``ballpass life SCENE``, copied to
``docs/images/<scene>_<figure>.png``, but those of `SPECTRA` and `ANSWERS`, which are
of commands as the how-to calls them.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path
from subprocess import run

import numpy as np
from PIL import Image

from ballpass.derive import generate
from ballpass.runtime import load
from ballpass.runtime.app.figure_run import run_for_figures
from ballpass.runtime.plot.gallery import draw, draw_all
from ballpass.runtime.plot.style import write_figures
from ballpass.runtime.questions.fit import fit
from ballpass.runtime.questions.life import life_figures
from ballpass.runtime.questions.question import declared

ROOT = Path(__file__).resolve().parent.parent
IMAGES = ROOT / "docs" / "images"

#: Pictures by scene.
PICTURES = {
    "punching_press": ("load_curve", "orbit", "spectra", "phase_portrait", "ball_loads", "peak_moment"),
    "four_bar": ("peak_moment",),
    "varying_compliance": ("orbit", "peak_moment"),
    "four_cylinder": ("shaft_loads",),
}

#: Spectra of the rotor with a table more, as the how-to pages call `ballpass spectrum`.
SPECTRA = {
    "waviness": (
        '\n[bearing.inner_waviness]\n9 = { amplitude = "0.2 um" }\n',
        ("--set", "bearing.clearance=-8 um", "--cycles", "420", "--window", "flattop"),
    ),
    "inner_spall": (
        '\n[bearing.defects.spall]\non = "inner"\nangle = "0 deg"\nchord = "1 mm"\nprofile = "path"\n',
        (
            *("--envelope", "2kHz:10kHz", "--cycles", "220"),
            *("--set", "loads.weight.force.y=-1 kN", "--set", "bearing.clearance=10 um"),
        ),
    ),
}


#: Figures of questions: the command's words, and the name of the figure that becomes ``docs/images/<name>.png``.
ANSWERS = {
    "steady_branches": (
        ("steady", "varying_compliance.toml", "--over", "shaft.speed=1940 rpm:1990 rpm"),
        "branches",
    ),
    "bifurcation_press": (
        (
            *("bifurcation", "punching_press_tangent.toml", "--set", "bearing.pitch_diameter=31.75 mm"),
            *("--vary", "bearing.clearance=5 um:45 um:61", "--readings", "40", "--settling", "20"),
        ),
        "bifurcation",
    ),
    "optimize_trace": (
        (
            *("optimize", "punching_press.toml", "--minimize", "peak_ball_force", "--cycles", "4", "--transient", "2"),
            *("--starts", "1", "--vary", "bearing.outer_ring.damping=1000 N*s/m:10000 N*s/m:log"),
        ),
        "trace",
    ),
    "sobol_press": (
        (
            *("sobol", "punching_press_tangent.toml", "--of", "peak_ball_force", "--samples", "1024"),
            *("--vary", "bearing.clearance=5 um:20 um", "--vary", "bearing.damping.ratio=2 us:3 us"),
            *("--vary", "mechanism.bodies.slider.mass=16 kg:17.5 kg", "--vary", "bearing.share=0.45:0.55"),
            *("--vary", "mechanism.bodies.rod.mass=2.4 kg:2.7 kg", "--vary", "bearing.outer_ring.mass=0.5 kg:0.6 kg"),
            *("--vary", "bearing.outer_ring.stiffness=30 MN/m:70 MN/m"),
            *("--vary", "bearing.outer_ring.damping=300 N*s/m:700 N*s/m"),
            *("--vary", "bearing.contact.young_modulus=200 GPa:214 GPa"),
            *("--vary", "bearing.pitch_diameter=33.49 mm:33.51 mm"),
        ),
        "sobol",
    ),
    "morris_press": (
        (
            *("morris", "punching_press_tangent.toml", "--of", "peak_ball_force"),
            *("--vary", "bearing.clearance=5 um:20 um", "--vary", "bearing.damping.ratio=2 us:3 us"),
            *("--vary", "mechanism.bodies.slider.mass=16 kg:17.5 kg", "--vary", "bearing.share=0.45:0.55"),
            *("--vary", "mechanism.bodies.rod.mass=2.4 kg:2.7 kg", "--vary", "bearing.outer_ring.mass=0.5 kg:0.6 kg"),
            *("--vary", "bearing.outer_ring.stiffness=30 MN/m:70 MN/m"),
            *("--vary", "bearing.outer_ring.damping=300 N*s/m:700 N*s/m"),
            *("--vary", "bearing.contact.young_modulus=200 GPa:214 GPa"),
            *("--vary", "bearing.pitch_diameter=33.49 mm:33.51 mm"),
        ),
        "morris",
    ),
}

#: Keys of the press's bearing that a designation gives.
OWN = ("balls", "ball_diameter", "pitch_diameter", "inner_groove_radius", "outer_groove_radius", "young_modulus")


def draw_lives() -> None:
    """Figures of the press's life; against clearance with the group that the bearing's name brings."""
    text = (ROOT / "scenes" / "punching_press.toml").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith((*(f"{key} = " for key in OWN), "poisson"))]
    named = "\n".join(lines).replace("[bearing]\n", '[bearing]\ndesignation = "6204"\n')
    named = named.replace('clearance = "10 um"', 'clearance = "CN"')
    for written, names in ((text, ("damage", "pressure")), (named, ("life_of_clearance",))):
        with tempfile.TemporaryDirectory() as folder:
            scene = Path(folder) / "punching_press.toml"
            scene.write_text(written, encoding="utf-8")
            model = load(generate(scene, Path(folder) / "generated"))
            write_figures(life_figures(model, model.life(), {}), Path(folder), ("png",), "life.md")
            for name in names:
                target = IMAGES / f"punching_press_{name}.png"
                shutil.copyfile(Path(folder) / f"{name}.png", target)
                print(target.relative_to(ROOT))


def draw_movie() -> None:
    """The four-bar over one turn, as `ballpass animate` writes it."""
    ballpass = Path(sys.executable).parent / "ballpass"
    with tempfile.TemporaryDirectory() as folder:
        words = ("--format", "gif", "--pictures", "60", "--out", folder)
        run([ballpass, "animate", ROOT / "scenes" / "four_bar.toml", *words], cwd=ROOT, check=True)
        shutil.copyfile(Path(folder) / "animation.gif", IMAGES / "four_bar.gif")


#: Pixels an inch and colours of the small pictures of all machines.
SMALL, COLOURS = 72, 48


def draw_machines() -> None:
    """Each shipped scene at its highest ball force, small, as ``docs/images/machine_<scene>.png``."""
    for path in sorted((ROOT / "scenes").glob("*.toml")):
        model = load(generate(path, ROOT / "generated" / path.stem))
        target = IMAGES / f"machine_{path.stem}.png"
        with tempfile.TemporaryDirectory() as folder:
            drawn = Path(folder) / "machine.png"
            draw("peak_moment", model, model.simulate()).savefig(drawn, dpi=SMALL)
            Image.open(drawn).convert("RGB").quantize(COLOURS).save(target, optimize=True)
        print(target.relative_to(ROOT))


def main() -> None:
    IMAGES.mkdir(exist_ok=True)
    draw_machines()
    draw_movie()
    draw_lives()
    for scene, names in PICTURES.items():
        model = load(generate(ROOT / "scenes" / f"{scene}.toml", ROOT / "generated" / scene))
        found = model.simulate()
        longer = run_for_figures(model, found)
        with tempfile.TemporaryDirectory() as folder:
            drawn = {path.stem: path for path in draw_all(model, found, Path(folder), longer=longer)}
            for name in names:
                target = IMAGES / f"{scene}_{name}.png"
                shutil.copyfile(drawn[name], target)
                print(target.relative_to(ROOT))
    for name, (table, words) in SPECTRA.items():
        with tempfile.TemporaryDirectory() as folder:
            scene_file = Path(folder) / "rotor.toml"
            text = (ROOT / "scenes" / "rotor.toml").read_text(encoding="utf-8")
            scene_file.write_text(text + table, encoding="utf-8")
            ballpass = Path(sys.executable).parent / "ballpass"
            run([ballpass, "spectrum", scene_file, "--of", "inner.ay", *words, "--out", folder], cwd=folder, check=True)
            shutil.copyfile(Path(folder) / "spectrum.png", IMAGES / f"spectrum_{name}.png")
    draw_answers()
    draw_fit()


def draw_fit() -> None:
    """Differences of a fit, with the data of the how-to."""
    model = load(generate(ROOT / "scenes" / "rotor.toml"))
    truth = {"bearing.clearance": 7e-6, "loads.unbalance.mass": 4e-3}
    solution = model.simulate(duration=0.1, sample_rate=5e3, parameters=truth)
    noise = 0.05 * np.std(solution["inner.y"]) * np.random.default_rng(1).standard_normal(len(solution.t))
    data = {"time": solution.t, "inner.y": solution["inner.y"] + noise}
    found = model.fit(data, ["bearing.clearance=2 um:15 um", "loads.unbalance.mass=1 g:20 g:log"])
    with tempfile.TemporaryDirectory() as folder:
        write_figures(declared(fit).figures(model, found, {}), Path(folder), ("png",), "fit.md")
        shutil.copyfile(Path(folder) / "residuals.png", IMAGES / "fit_residuals.png")


def draw_answers() -> None:
    """Figures of questions."""
    ballpass = Path(sys.executable).parent / "ballpass"
    for name, ((question, scene, *words), figure) in ANSWERS.items():
        with tempfile.TemporaryDirectory() as folder:
            run([ballpass, question, ROOT / "scenes" / scene, *words, "--out", folder], cwd=folder, check=True)
            shutil.copyfile(Path(folder) / f"{figure}.png", IMAGES / f"{name}.png")


if __name__ == "__main__":
    main()
