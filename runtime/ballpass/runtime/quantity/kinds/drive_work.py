"""Work of the drive in a turn."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.quantity.records import Estimate, Kind, Quantity, View
from ballpass.runtime.run.driver_angle import TURN


def _drive_work(view: View, quantity: Quantity) -> Estimate:
    mechanism = view.manifest.mechanism
    assert mechanism is not None  # it has a drive torque
    value, slope = view.mean(*view.channel(quantity))
    # mean torque times the angle of a turn, which does not depend on parameters
    angle = math.copysign(TURN, view.numbers.values[mechanism.speed])
    return Estimate(value=angle * value, slope=angle * slope)


def _check(manifest: Manifest, _values: Mapping[str, float], quantity: Quantity) -> None:
    if manifest.mechanism is not None and manifest.mechanism.angle:
        raise RequestError(
            f"{quantity.name}: the driver's speed changes in this scene, and its turns are not alike. Ask for "
            "mean:drive_power, times the length of the run."
        )


KINDS = (
    Kind(
        name="drive_work",
        summary="work of the drive in a turn",
        takes="nothing",
        channel="drive_torque",
        unit="J",
        check=_check,
        evaluate=_drive_work,
    ),
)
