"""Maps of motions: kinds and exponents of the one-parameter diagram, of closed forms, and of points on their own."""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from matplotlib.colors import to_rgb
from test_figures import luminance

from ballpass.runtime import Model, RequestError
from ballpass.runtime.ask.kept_parts import KeptParts
from ballpass.runtime.many.cluster import connected
from ballpass.runtime.motion import map_blocks
from ballpass.runtime.motion.map_points import MapRequest, PointMotions, motions
from ballpass.runtime.motion.strobe import strobe_of
from ballpass.runtime.plot.motion_map import COLOURS, draw_map

THREE_EIGHTHS = {"bearing.pitch_diameter": 31.75e-3}
RPM = math.tau / 60.0

#: Time from ball to ball on the load line [s], at that speed [rad/s].
PERIOD, SPEED = 0.05, 393.1540342298 * RPM

#: A plane with motions of one and of two periods.
PLANE = ("shaft.speed=1955 rpm:1967 rpm:3", "bearing.clearance=0 um:0.2 um:2")


def test_the_exponent_of_a_preloaded_rotor_is_its_damping_over_speed_and_damping(rotor: Model) -> None:
    """All four multipliers have the modulus exp(-c T / 2m): by Liouville, as they are two complex pairs."""
    found = rotor.bifurcation(
        ["shaft.speed=300 rpm:1500 rpm:3", "bearing.inner_ring.damping=150 N*s/m:400 N*s/m:2"],
        parameters={"bearing.clearance": -4e-6},
        readings=20,
    )
    speed, damping = np.meshgrid(*(one.values for one in found.vary), indexing="ij")
    wanted = -damping / (2.0 * 20.0) * PERIOD * SPEED / speed
    assert np.all(found.kinds == "periodic 1")
    assert np.all(np.abs(found.exponent - wanted) < found.half)
    assert np.max(found.half) < 2e-3


def test_periods_double_where_the_multiplier_passes_minus_one(rotor: Model) -> None:
    found = rotor.bifurcation(PLANE, readings=20)
    assert found.kinds[:, 0].tolist() == ["periodic 1", "periodic 1", "periodic 2"]  # at 1961.14639 rpm
    assert set(found.kinds[:, 1]) == {"periodic 1"}
    assert "periodic 1 1955 to 1961; periodic 2 1967" in str(found)
    assert not rotor.bifurcation(PLANE, readings=20, exponent=False).exponents


@pytest.mark.long
def test_kinds_and_exponents_are_those_of_one_parameter_by_tangents(rotor: Model) -> None:
    speeds, clearances = "shaft.speed=300 rpm:2200 rpm:8", "bearing.clearance=0 um:12 um:6"
    found, same = rotor.bifurcation([speeds, clearances]), []
    for j, clearance in enumerate(found.vary[1].values):
        line = rotor.bifurcation(speeds, parameters={"bearing.clearance": float(clearance)})
        for i, (up, down) in enumerate(zip(line.up, line.down[::-1], strict=True)):
            assert up.exponent is not None
            assert down.exponent is not None
            if up.kind == down.kind and abs(up.exponent.mean - down.exponent.mean) < 1e-6:
                same.append(found.kinds[i, j] == up.kind)
                if same[-1]:
                    assert abs(found.exponent[i, j] - up.exponent.mean) < found.half[i, j] + up.exponent.half
    assert len(same) > 0.8 * found.kinds.size
    assert np.mean(same) > 0.95  # there may be a motion that neither direction comes to


@pytest.mark.long
def test_tangents_give_exponents_of_the_press_where_differences_sink_into_rounding(
    make_model: Callable[..., Model],
) -> None:
    press = make_model("punching_press_tangent")
    plane = ["bearing.clearance=10 um:39.9 um:2", "mechanism.driver.speed=500 rpm:501 rpm:2"]
    found = press.bifurcation(plane, parameters=THREE_EIGHTHS, readings=20, settling=2)
    assert found.kinds[:, 0].tolist() == ["periodic 1", "chaotic"]
    assert found.exponent[0, 0] == pytest.approx(-9.893456, abs=1e-5)  # a small disturbance falls to e-5 in a turn
    line = press.bifurcation("bearing.clearance=39.9 um:40 um:2", parameters=THREE_EIGHTHS).up[0]
    assert line.exponent is not None
    assert abs(found.exponent[1, 0] - line.exponent.mean) < found.half[1, 0] + line.exponent.half


def _asked(rotor: Model) -> MapRequest:
    period = strobe_of(rotor, {}, (), "map").period
    assert period is not None
    return MapRequest(period=period, readings=20, settling=5, rtol=None, exponent=True)


def test_a_point_has_the_same_bits_alone_and_among_others(rotor: Model) -> None:
    table = {"shaft.speed": np.array([900.0, 1200.0, 1965.0]) * RPM, "bearing.clearance": np.array([0.0, 5e-6, 0.0])}
    together = motions(rotor, table, _asked(rotor))
    for k in range(3):
        alone = motions(rotor, {name: all_[k : k + 1] for name, all_ in table.items()}, _asked(rotor))
        for name in ("kind", "exponent", "half"):
            assert np.array_equal(getattr(alone, name), getattr(together, name)[k : k + 1])


def test_points_that_cannot_be_are_without_a_motion_and_say_why(rotor: Model) -> None:
    table = {"shaft.speed": np.full(2, 1000.0 * RPM), "bearing.ball_diameter": np.array([7.9375e-3, 40e-3])}
    found = motions(rotor, table, _asked(rotor))
    assert found.kind.tolist() == ["periodic 1", "no motion"]
    assert "ball_diameter" in found.open[1]
    assert np.isnan(found.exponent[1])


def test_a_killed_map_computes_the_rest_alone(rotor: Model, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    calls, plane = [], ["shaft.speed=900 rpm:1900 rpm:4", "bearing.clearance=0 um:2 um:6"]

    def counted(*given: Any) -> PointMotions:
        calls.append(given)
        return motions(*given)

    monkeypatch.setattr(map_blocks, "motions", counted)
    whole = rotor.bifurcation(plane, readings=20)
    total, write = len(calls), KeptParts.write
    calls.clear()

    def killed(self: KeptParts, *given: Any) -> Any:
        if len(list(keep.iterdir())) == 1:
            raise KeyboardInterrupt
        return write(self, *given)

    keep = tmp_path / "parts"
    with monkeypatch.context() as patch:
        patch.setattr(KeptParts, "write", killed)
        with pytest.raises(KeyboardInterrupt):
            rotor.bifurcation(plane, readings=20, keep=keep)
    calls.clear()
    again = rotor.bifurcation(plane, readings=20, keep=keep)
    assert total > 2
    assert len(calls) == total - 1
    assert again.to_json() == whole.to_json()
    assert not keep.exists()


@pytest.mark.long
def test_points_on_a_cluster_are_those_of_threads(rotor: Model) -> None:
    here = rotor.bifurcation(PLANE, readings=20)
    with connected(None, 2) as client:
        there = rotor.bifurcation(PLANE, readings=20, client=client)
    assert there.to_json() == here.to_json()


def test_a_map_is_a_file_with_units_and_a_picture_that_survives_greyscale(rotor: Model) -> None:
    found = rotor.bifurcation(PLANE, readings=20)
    data = xarray.open_dataset(io.BytesIO(found.netcdf()), engine="h5netcdf")
    assert data["shaft.speed"].units == "rad/s"
    assert data["kind"].sel({"bearing.clearance": 0.0}).values.tolist() == found.kinds[:, 0].tolist()
    assert np.array_equal(data["exponent"], found.exponent)
    xarray.testing.assert_equal(data, found.to_xarray())
    steps = np.diff([luminance(to_rgb(colour)) for colour in COLOURS.values()])
    assert np.all(steps < -8.0)
    figure = draw_map(found.vary, found.kinds, found.exponent)
    assert [axes.get_xlabel() for axes in figure.axes[:2]] == ["Speed of the shaft [rpm]"] * 2
    assert "µm" in figure.axes[0].get_ylabel()
    assert {text.get_text() for text in figure.legends[0].get_texts()} == {"periodic 1", "periodic 2"}


@pytest.mark.parametrize(
    ("vary", "given", "words"),
    [
        ([*PLANE, "bearing.inner_ring.damping=1 N*s/m:2 N*s/m:2"], {}, "one parameter, or two that differ"),
        ([PLANE[0], PLANE[0]], {}, "one parameter, or two that differ"),
        (PLANE, {"of": "inner.y"}, "a map shows no state"),
        (PLANE, {"client": 5}, "a Client of dask.distributed is expected"),
        (PLANE[0], {"client": 5}, "which no cluster shortens"),
    ],
)
def test_wrong_maps_are_refused(rotor: Model, vary: Any, given: dict[str, Any], words: str) -> None:
    with pytest.raises(RequestError, match=words):
        rotor.bifurcation(vary, **given)


def test_the_papers_press_has_no_readings_for_a_map(press: Model) -> None:
    with pytest.raises(RequestError, match=r"pitch_diameter=.31.75 mm"):
        press.bifurcation(
            ["bearing.clearance=5 um:10 um:2", "mechanism.driver.speed=400 rpm:500 rpm:2"], exponent=False
        )
