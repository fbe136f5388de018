"""What must hold of a scene with parts of one's own, and of a kind of quantity, tried on a run.

In: the scene, or the quantity's name.  Out: nothing, or what does not hold.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from ballpass.derive import generate, read_scene, shipped_scenes
from ballpass.runtime import load
from ballpass.runtime.contract.plugins import use
from ballpass.testing.damping_law import ConformanceError


def check_scene(
    scene: str | Path,
    of: str | Sequence[str] | None = None,
    *,
    cycles: float | None = None,
    plugins: Sequence[str] = (),
) -> None:
    """Check a scene file with force laws, torque laws, rolling elements or effects of your own.

    Quantities of a run are differentiated by every number of the scene.  The derivatives are those of differences
    where every force that jumps does so where a step ends.  They add up as powers of kilogram, metre and second where
    every number has its unit.

    Parameters
    ----------
    scene : file
    of : as for `Model.sensitivity`
    cycles : turns from the start; those of the scene, without its transient, if not given
    plugins : see `read_scene`

    Raises
    ------
    ConformanceError
        With what does not hold.

    Examples
    --------
    >>> check_scene("scenes/varying_compliance.toml", "rms:inner.y", cycles=1)
    """
    use(plugins)
    with tempfile.TemporaryDirectory() as place:
        model = load(generate(read_scene(scene), Path(place) / "conformance"))
        report = model.sensitivity(of, cycles=cycles, transient=None if cycles is None else 0).report()
    if report.fault:
        raise ConformanceError(f"{scene}: {report.fault}")


def check_quantity(name: str, *, cycles: float = 1, plugins: Sequence[str] = ()) -> None:
    """Check value, derivative and unit of a kind of quantity, as `check_scene` does, of a bearing under constant load.

    Parameters
    ----------
    name : as in ``--of``
    cycles, plugins : as for `check_scene`

    Raises
    ------
    ConformanceError
        With what does not hold.

    Examples
    --------
    >>> check_quantity("max:ball.force")
    """
    check_scene(shipped_scenes()["varying-compliance"], name, cycles=cycles, plugins=plugins)
