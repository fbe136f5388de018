"""Claims about ``ballpass sweep``: its grid is that of single runs, a failing member costs no other; its refusals."""

from __future__ import annotations

import csv
import itertools
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import xarray
from matplotlib.image import imread
from typer.testing import Result

from ballpass.derive import read_scene
from ballpass.runtime import load
from ballpass.runtime.app.commands.ranges import read_ranges
from ballpass.runtime.ask.parameter_range import MOST, ParameterRange
from ballpass.runtime.plot.style import GREY
from ballpass.runtime.plot.sweep import LUMINANCE, draw_sweep

ROOT = Path(__file__).resolve().parent.parent
SCENE = ROOT / "scenes" / "varying_compliance.toml"
SHORT = ("--cycles", "1.5", "--transient", "0.5", "--rtol", "1e-9")
QUANTITIES = ("peak_ball_force", "rms:inner.y")
CLEARANCE, LOAD = "bearing.clearance", "load.force.x"


@pytest.fixture(scope="module")
def sweep(ballpass: Callable[..., Result]) -> Callable[..., Result]:
    return partial(ballpass, "sweep")


@pytest.fixture(scope="module")
def grid(site: Path, sweep: Callable[..., Result]) -> Path:
    """Results of a grid of clearance and load, with another damping than the scene's."""
    of = [word for name in QUANTITIES for word in ("--of", name)]
    ranges = ("--vary", f"{CLEARANCE}=-4 um:2 um:3", "--vary", f"{LOAD}=100 N:400 N:2:log")
    done = sweep(SCENE, *ranges, *of, *SHORT, "--set", "bearing.inner_ring.damping=300 N*s/m", "--out", "grid")
    assert done.exit_code == 0, done.output
    return site / "grid"


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "sweep.csv").open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_a_grid_holds_what_single_runs_reduce_to(grid: Path, site: Path) -> None:
    """Each member beside the driver of single runs at a tighter tolerance; no ball rattles at these clearances."""
    model = load(site / "generated" / "varying_compliance")
    dataset = xarray.load_dataset(grid / "sweep.nc", engine="h5netcdf")
    assert dataset["peak_ball_force"].dims == (CLEARANCE, LOAD)
    for clearance, force in itertools.product((-4e-6, -1e-6, 2e-6), (100.0, 400.0)):
        alone = model.reduce(
            cycles=1.5,
            transient=0.5,
            rtol=1e-11,
            parameters={CLEARANCE: clearance, LOAD: force, "bearing.inner_ring.damping": 300.0},
        )
        found = dataset.sel({CLEARANCE: clearance, LOAD: force}, method="nearest")
        assert found["peak_ball_force"].item() == pytest.approx(alone["ball.force"].maximum, rel=1e-5)
        assert found["rms:inner.y"].item() == pytest.approx(alone["inner.y"].rms, rel=1e-5, abs=0.0)


def test_a_generated_folder_gives_the_numbers_of_its_scene_and_says_its_faults(
    site: Path, sweep: Callable[..., Result]
) -> None:
    ranges = ("--vary", f"{LOAD}=100 N:400 N:3:log", "--set", f"{CLEARANCE}=1 um")
    for source, out in ((SCENE, "by_scene"), (site / "generated" / "varying_compliance", "by_folder")):
        done = sweep(source, *ranges, "--of", QUANTITIES[0], *SHORT, "--no-figures", "--out", out)
        assert done.exit_code == 0, done.output
    assert (site / "by_folder" / "sweep.csv").read_bytes() == (site / "by_scene" / "sweep.csv").read_bytes()
    wrong = ("bearing.clearence=1 um:2 um:3", f"{CLEARANCE}=1 N:2 N:3", f"{LOAD}=1 N:2 N")
    done = sweep(site / "generated" / "varying_compliance", *(word for one in wrong for word in ("--vary", one)))
    assert done.exit_code == 2
    assert [part in done.stderr for part in ("bearing.clearance", "a length", "no range")] == [True] * 3


def test_table_grid_and_report_hold_the_same_numbers_with_units(grid: Path) -> None:
    dataset = xarray.load_dataset(grid / "sweep.nc", engine="h5netcdf")
    report = json.loads((grid / "sweep.json").read_text(encoding="utf-8"))
    table = rows(grid)
    assert len(table) == report["members"] == 6
    for member, (i, j) in enumerate(np.ndindex(3, 2)):
        row, point = table[member], dataset.isel({CLEARANCE: i, LOAD: j})
        assert float(row[f"{CLEARANCE} [m]"]) == point[CLEARANCE].item()
        assert float(row[f"{LOAD} [N]"]) == point[LOAD].item()
        for name, unit in zip(QUANTITIES, ("N", "m"), strict=True):
            assert point[name].attrs["units"] == unit == report["quantities"][name]["unit"]
            value = float(row[f"{name} [{unit}]"])
            assert value == point[name].item() == report["quantities"][name]["values"][member]
        assert row["status"] == point["status"].item() == "DONE"
    assert dataset.attrs["title"] == report["title"]
    assert set(dataset.coords) == {CLEARANCE, LOAD, "bearing.inner_ring.damping"}  # also what one value was set for
    damping = dataset.coords["bearing.inner_ring.damping"]
    assert (damping.item(), damping.attrs["units"]) == (300.0, "N*s/m")
    assert all(values.attrs["long_name"] for values in dataset.variables.values())
    assert dataset[CLEARANCE].attrs["units"] == "m"
    assert dataset[CLEARANCE].to_numpy() == pytest.approx([-4e-6, -1e-6, 2e-6], rel=1e-12, abs=0.0)
    assert dataset["bearing.inner_ring.damping"].item() == 300.0
    assert report["set"] == {"bearing.inner_ring.damping": 300.0}
    assert [one["spacing"] for one in report["varied"]] == ["linear", "logarithmic"]


def test_a_map_of_two_parameters_and_a_line_of_one_are_drawn(
    grid: Path, site: Path, sweep: Callable[..., Result]
) -> None:
    for name in ("sweep_peak_ball_force.png", "sweep_rms_inner_y.png"):
        assert imread(grid / name).shape[1] == 1200
    # a new sweep of other quantities leaves no figure that would pass for its own
    done = sweep(SCENE, "--vary", f"{CLEARANCE}=1um:9um:2", "--of", "range:inner.x", *SHORT, "--out", grid)
    assert done.exit_code == 0, done.output
    assert [path.name for path in sorted(grid.glob("*.png"))] == ["sweep_range_inner_x.png"]


def test_a_sweep_locates_kinks_where_single_runs_do_and_says_so(site: Path, sweep: Callable[..., Result]) -> None:
    """Each member is then the single run that locates them; no ball rattles at these clearances."""
    words = ("--vary", f"{CLEARANCE}=2um:5um:2", "--of", "peak_ball_force", *SHORT, "--no-figures", "--json")
    done = sweep(SCENE, *words, "--out", "located")
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert (report["statistics"]["kinks"], report["statistics"]["lanes"]) == ("located", 1)
    model = load(site / "generated" / "varying_compliance")
    found = report["quantities"]["peak_ball_force"]["values"]
    for clearance, peak in zip(report["varied"][0]["values"], found, strict=True):
        numbers = {CLEARANCE: clearance}
        alone = model.reduce(cycles=1.5, transient=0.5, rtol=1e-9, parameters=numbers)
        assert peak == pytest.approx(alone["ball.force"].maximum, rel=1e-9)
    over = sweep(SCENE, *words, "--kinks", "stepped-over", "--out", "over")
    lanes = json.loads(over.stdout)
    assert lanes["statistics"]["kinks"] == "stepped-over"
    # and they are other runs
    assert lanes["quantities"]["peak_ball_force"]["values"][1] != pytest.approx(found[1], rel=1e-9)


def test_three_varied_parameters_have_no_figure_and_are_told_so(site: Path, sweep: Callable[..., Result]) -> None:
    third = "bearing.inner_ring.damping=100 N*s/m:200 N*s/m:2"
    ranges = ("--vary", f"{CLEARANCE}=1um:9um:2", "--vary", f"{LOAD}=90N:99N:2", "--vary", third)
    done = sweep(SCENE, *ranges, *SHORT, "--out", "three", "--json")
    assert done.exit_code == 0, done.output
    assert "no figure" in done.stderr
    report = json.loads(done.stdout)
    assert report["members"] == 8
    assert list(report["quantities"]) == [
        "peak_ball_force", "rms_inner_x", "rms_inner_y", "range_inner_x", "range_inner_y"
    ]  # fmt: skip
    assert sorted(path.name for path in (site / "three").glob("[!.]*")) == ["sweep.csv", "sweep.json", "sweep.nc"]


def test_a_member_that_fails_is_named_and_the_others_are_kept(site: Path, sweep: Callable[..., Result]) -> None:
    """At speed zero there are no turns to run; the other two members have what they have without it."""
    words = ("--of", "peak_ball_force", *SHORT)
    done = sweep(SCENE, "--vary", "shaft.speed=-400rpm:400rpm:3", *words, "--out", "failing")
    assert done.exit_code == 0, done.output
    table = rows(site / "failing")
    assert [row["status"] for row in table] == ["DONE", "REFUSED", "DONE"]
    assert "nothing turns" in table[1]["message"]
    assert table[1]["peak_ball_force [N]"] == ""
    assert "shaft.speed = 0 rpm: REFUSED" in done.stderr
    assert "3 members, 1 without results" in done.stdout
    whole = sweep(SCENE, "--vary", "shaft.speed=-400rpm:400rpm:2", *words, "--out", "whole")
    assert whole.exit_code == 0, whole.output
    key = "peak_ball_force [N]"
    assert [row[key] for row in rows(site / "whole")] == [table[0][key], table[2][key]]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "no number to vary"),
        (("--vary", "bearing.balls=6:9:4"), "decides which equations are derived"),
        (("--vary", "bearing.damping.law=1:2:2"), "decides which equations are derived"),
        (("--vary", "run.cycles=1:9:3"), "setting of the run"),
        (("--vary", "bearing.clearence=0um:9um:4"), 'did you mean "bearing.clearance"'),
        (("--vary", f"{CLEARANCE}=0:9um:4"), "unit is missing"),
        (("--vary", f"{CLEARANCE}=0um:9N:4"), "wrong dimension for a length"),
        (("--vary", f"{CLEARANCE}=0um:9um"), "PATH=A:B:N"),
        (("--vary", f"{CLEARANCE}=0um:9um:4:lin"), "no range"),
        (("--vary", f"{CLEARANCE}=0um:9um:1"), "whole numbers from 2"),
        (("--vary", f"{CLEARANCE}=0um:9um:2.5"), "whole numbers from 2"),
        (("--vary", f"{CLEARANCE}=0um:9um:4:log"), "no logarithm"),
        (("--vary", f"{CLEARANCE}=9um:9um:4"), "both ends are 9um"),
        (("--vary", "bearing.ball_diameter=-1mm:8mm:4"), "above 0"),
        (("--vary", f"{CLEARANCE}=1um:9um:2", "--vary", f"{CLEARANCE}=1um:9um:3"), "given twice"),
        (("--vary", f"{CLEARANCE}=1um:9um:2", "--set", f"{CLEARANCE}=2um"), "given twice"),
        (("--vary", f"{CLEARANCE}=1um:9um:2", "--set", f"{LOAD}=2N", "--set", f"{LOAD}=3N"), "2N and 3N"),
        (("--vary", f"{CLEARANCE}=1um:9um:2000000"), f"from 2 to {MOST}"),
        (("--vary", f"{CLEARANCE}=1um:9um:2000000000"), f"from 2 to {MOST}"),
        (("--vary", f"{CLEARANCE}=1um:9um:2000", "--vary", f"{LOAD}=2N:9N:2000"), f"at most {MOST}"),
        (("--vary", f"{CLEARANCE}=1um:9um:2", "--of", "peak_ball_farce"), "peak_ball_force"),
        (("--vary", f"{CLEARANCE}=1um:9um:2", "--threads", "0"), "from 1 on"),
        (("--vary", f"{CLEARANCE}=1um:9um:2", "--rtol", "3"), "1e-13 to 0.1"),
        (("--vary", f"{CLEARANCE}=1um:9um:2", "--cycles", "2", "--duration", "1s"), "both given"),
        (("--vary", f"{CLEARANCE}=1um:9um:2", "--method", "cvodes"), "project's own stepper"),
        (("--vary", f"{CLEARANCE}=1um:9um:2", "--kinks", "locate"), "Did you mean 'located'"),
        (("--vary", f"{CLEARANCE}=1um:9um:2", "--method", "cvodes", "--kinks", "located"), "project's own stepper"),
        # a preload that leaves no room for a ball: every member is refused
        (("--vary", f"{CLEARANCE}=-9mm:-8mm:2"), "none of the 2 members"),
    ],
)
def test_bad_requests_end_with_exit_code_2_and_no_folder(
    site: Path, sweep: Callable[..., Result], words: tuple[str, ...], told: str
) -> None:
    done = sweep(SCENE, *words, "--out", "never")
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    assert told in done.stderr
    assert not (site / "never").exists()


def test_ranges_have_both_ends_and_equal_steps_or_factors() -> None:
    scene = read_scene(SCENE)
    even, factors = read_ranges(scene, [f"{CLEARANCE}=-4um:0.011 mm:4", f"{LOAD}=1N:1kN:4:log"], {})
    assert even.values == pytest.approx([-4e-6, 1e-6, 6e-6, 11e-6], rel=1e-12, abs=0.0)
    assert even.shown == pytest.approx([-4.0, 1.0, 6.0, 11.0])
    assert (even.shown_unit, factors.shown_unit) == ("um", "N")
    assert factors.values == pytest.approx([1.0, 10.0, 100.0, 1000.0], rel=1e-12)


def test_colours_of_a_map_grow_in_luminance_by_equal_steps() -> None:
    """Luminance (CIE L*) of sRGB from its definition: a greyscale print keeps the order of values."""
    colours = LUMINANCE(np.linspace(0.0, 1.0, 41))[:, :3]
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    lightness = 116.0 * np.cbrt(linear @ [0.2126, 0.7152, 0.0722]) - 16.0
    steps = np.diff(lightness)
    assert steps.min() > 0.5 * steps.mean()


def test_a_map_without_change_or_with_gaps_is_drawn_and_one_without_values_refused() -> None:
    axes = [
        ParameterRange(
            name="a",
            unit="m",
            words="first",
            low=1e-6,
            high=4e-6,
            count=3,
            shown_unit="um",
            factor=1e-6,
            logarithmic=True,
        ),
        ParameterRange(name="b", unit="N", words="second", low=5.0, high=3.0, count=2, shown_unit="N"),
    ]
    values = np.arange(6.0).reshape(3, 2)
    values[1, 1] = np.nan
    figure = draw_sweep("t", axes, "q", "quantity", "N", values, "")
    crosses = [line for line in figure.axes[0].lines if line.get_color() == GREY]
    (place,) = (line.get_xydata()[0] for line in crosses)
    assert place == pytest.approx((2.0, 3.0))
    draw_sweep("t", axes, "q", "quantity", "N", np.ones((3, 2)), "").canvas.draw()
