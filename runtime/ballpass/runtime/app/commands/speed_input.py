"""`ballpass export --fmu --input mechanism.driver.speed` where the scene's driver turns at constant speed.

In: a scene file.  Out: a generated folder of the same scene with the driver's speed as a table over time, whose rows
are equal.  There the driver's angle and speed are states, so that the speed may change.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ballpass.runtime.app.commands.shared import Stages
from ballpass.runtime.contract import Manifest
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.export.model_description import SPEED


def speed_becomes_input(manifest: Manifest, inputs: Sequence[str]) -> bool:
    """Whether the inputs include the driver's speed of a scene in which that speed is constant."""
    mechanism = manifest.mechanism
    return mechanism is not None and not mechanism.angle and not {SPEED, "mechanism.driver"}.isdisjoint(inputs)


@contextmanager
def with_speed_over_time(scene: Path, stages: Stages) -> Iterator[Path]:
    """Folder, for the time of the context, of a scene file with its driver's constant speed as a table of time.

    Raises
    ------
    RequestError
        The scene has a feature that a driver with a table of its speed does not allow.
    """
    from ballpass.derive import SceneError, generate, read_scene

    mechanism = read_scene(scene).mechanism
    assert mechanism is not None
    speed = f"{mechanism.driver.speed.value!r} rad/s"
    table = {"time": ["0 s", "1 s"], "speed": [speed, speed]}
    # states of a duty cycle may set the speed by its old name, and are for lives alone
    changes = {"mechanism": {"driver": {"speed": None, "table": table}}, "duty": None}
    try:
        changed = read_scene(scene, changes=changes)
    except SceneError as error:
        raise RequestError(
            f"input {SPEED!r}: with a speed that changes, here [mechanism.driver.table], this scene is refused. Leave "
            f"the speed a parameter, or correct this:\n{error}"
        ) from error
    with tempfile.TemporaryDirectory() as place:
        yield generate(changed, Path(place) / scene.stem, progress=stages)
