"""Print how much of a disk each way to install ballpass takes, as the table of docs/howto/install.md.

Builds both wheels, makes a virtual environment in a temporary folder and installs one after the other, each with what
the one before it has.  Takes some minutes and downloads a gigabyte.

usage: python scripts/sizes.py
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

#: What is installed, and what for.
STEPS = {
    "ballpass-runtime": "run generated folders",
    "ballpass-runtime[analysis]": "and spectra, natural modes",
    "ballpass-runtime[figures]": "and figures",
    "ballpass": "scenes, equations, all commands",
    "ballpass[labelled]": "and `to_xarray`, `to_pandas`",
    "ballpass[labelled,scale]": "and data sets, clusters",
    "ballpass[labelled,scale,compiler]": "and a C compiler (Zig's)",
}


def build_wheels(folder: Path) -> Path:
    """Wheels of both distributions, by way of their source distributions; the folder that holds them."""
    folder.mkdir(exist_ok=True)
    for source in (ROOT / "runtime", ROOT):
        subprocess.run(
            (sys.executable, "-m", "build", "--outdir", folder, source),
            check=True, stdout=subprocess.DEVNULL, cwd=folder,
        )  # fmt: skip
    return folder


def make_environment(folder: Path) -> Path:
    """A virtual environment with nothing but pip; its folder of programs."""
    venv.create(folder, with_pip=True)
    return folder / "bin"


def install(programs: Path, wheels: Path, what: str) -> None:
    """Install a distribution from the wheels, the rest from the registry in the versions of requirements.txt."""
    name, bracket, extras = what.partition("[")
    (wheel,) = wheels.glob(f"{name.replace('-', '_')}-*.whl")
    subprocess.run(
        (
            *(programs / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"),
            *("--find-links", wheels, "-c", ROOT / "requirements.txt", f"{name}{bracket}{extras} @ {wheel.as_uri()}"),
        ),
        check=True,
    )


def installed_megabytes(programs: Path) -> float:
    """Size of the environment's packages without pip and setuptools, which are no part of ballpass [MB]."""
    (packages,) = programs.parent.glob("lib/python*/site-packages")
    names = ("pip", "setuptools", "pkg_resources", "_distutils_hack", "distutils-precedence")
    ours = (path for path in packages.iterdir() if not path.name.startswith(names))
    return sum(file.stat().st_size for path in ours for file in (path, *path.rglob("*")) if file.is_file()) / 1e6


def main() -> None:
    """Print the table."""
    print("| `pip install` | for | MB |\n| --- | --- | ---: |")
    with tempfile.TemporaryDirectory() as place:
        wheels = build_wheels(Path(place) / "wheels")
        programs = make_environment(Path(place) / "environment")
        for what, use in STEPS.items():
            install(programs, wheels, what)
            print(f"| `{what}` | {use} | {installed_megabytes(programs):.0f} |", flush=True)


if __name__ == "__main__":
    main()
