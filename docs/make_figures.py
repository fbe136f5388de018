"""Make the pictures of README and documentation anew: ``.venv/bin/python docs/make_figures.py``.

Every picture is a figure of ``ballpass run SCENE``, copied to ``docs/images/<scene>_<figure>.png``.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from ballpass.derive import generate
from ballpass.runtime import load
from ballpass.runtime.app.figures.gallery import draw_all

ROOT = Path(__file__).resolve().parent.parent
IMAGES = ROOT / "docs" / "images"

#: Pictures by scene.
PICTURES = {
    "punching_press": ("load_curve", "orbit", "spectra", "phase_portrait", "ball_loads", "peak_moment"),
    "four_bar": ("peak_moment",),
    "varying_compliance": ("orbit", "peak_moment"),
}


def main() -> None:
    IMAGES.mkdir(exist_ok=True)
    for scene, names in PICTURES.items():
        model = load(generate(ROOT / "scenes" / f"{scene}.toml", ROOT / "generated" / scene))
        with tempfile.TemporaryDirectory() as folder:
            drawn = {path.stem: path for path in draw_all(model, model.simulate(), Path(folder))}
            for name in names:
                target = IMAGES / f"{scene}_{name}.png"
                shutil.copyfile(drawn[name], target)
                print(target.relative_to(ROOT))


if __name__ == "__main__":
    main()
