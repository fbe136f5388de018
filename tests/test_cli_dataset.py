"""Claims about ``ballpass dataset``: what a specification says is what is made; its faults are told together."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray
from sklearn.ensemble import RandomForestClassifier
from typer.testing import CliRunner

from ballpass.runtime import Model, load
from ballpass.runtime.app.cli import app
from ballpass.runtime.app.commands.data_set_spec import read_spec
from ballpass.runtime.contract.errors import BallpassError
from ballpass.runtime.quantity.characteristic import characteristic_lines
from ballpass.runtime.vibration.diagnosis import diagnosis, envelope

ROOT = Path(__file__).resolve().parent.parent
SPEC = f"""title = "Tight and loose"
scene = "{ROOT}/scenes/varying_compliance.toml"
seed = 7
members = 40
outputs = ["inner.ax"]
sample_rate = "10 kHz"
duration = "50 ms"
transient = "20 ms"
rtol = 1e-5
snr = 20

[parameters]
"shaft.speed" = {{ distribution = "uniform", loc = "1000 rpm", scale = "500 rpm" }}
"bearing.ball_angle" = "10 deg"

[classes.tight]
parameters."bearing.clearance" = {{ distribution = "triang", c = 0.5, loc = "1 um", scale = "2 um" }}

[classes.stiff]
changes.bearing.contact.stiffness = "20e9 N/m^1.5"
changes.bearing.balls = 9

[classes.loose]
members = 60
parameters."bearing.clearance" = {{ distribution = "loguniform", a = "10 um", b = "40 um" }}
parameters."shaft.speed" = "800 rpm"
"""


def test_a_specification_is_read_in_si_with_changes_of_its_scene(tmp_path: Path) -> None:
    path = tmp_path / "set.toml"
    path.write_text(SPEC)
    spec = read_spec(path)
    tight, stiff, loose = spec.classes
    assert (spec.seed, spec.signals.snr, spec.signals.sample_rate, spec.signals.duration) == (7, 20.0, 10e3, 0.05)
    assert [one.members for one in spec.classes] == [40, 40, 60]
    rpm = 2.0 * np.pi / 60.0
    assert tight.parameters["shaft.speed"].arguments == pytest.approx({"loc": 1000 * rpm, "scale": 500 * rpm})  # type: ignore[union-attr]
    assert loose.parameters["shaft.speed"] == pytest.approx(800 * rpm)
    assert loose.parameters["bearing.ball_angle"] == pytest.approx(np.radians(10.0))
    clearance = tight.parameters["bearing.clearance"].arguments  # type: ignore[union-attr]
    assert clearance == pytest.approx({"c": 0.5, "loc": 1e-6, "scale": 2e-6})
    ends = loose.parameters["bearing.clearance"].values(np.array([0.0, 1.0]))  # type: ignore[union-attr]
    assert ends == pytest.approx([10e-6, 40e-6])
    assert [one.scene.bearing.balls for one in spec.classes] == [8, 9, 8]  # type: ignore[union-attr]
    values = {quantity.path: quantity.value for quantity in stiff.scene.quantities}
    assert values["bearing.contact.stiffness"] == 20e9
    assert stiff.scene.outputs == ("inner.ax",)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("seed = 7", "", "seed: this key is missing"),
        ("members = 40", 'members = "many"', "members (line 4): this is not a whole number"),
        ('"10 kHz"', '"10 m"', "sample_rate (line 6): the unit \"m\" has the wrong dimension"),
        ("snr = 20", "snr = { loc = 3 }", "the name of the distribution is missing"),
        ('"triang", c', '"triangle", c', "Did you mean 'triang'"),
        ("c = 0.5, ", "", "Expected: c; loc and scale"),
        ('"shaft.speed" = {', '"shaft.sped" = {', "There is no number of the scene 'shaft.sped'"),
        ("members = 60", "member = 60", 'classes.loose.member (line 24): unknown key'),
        ("balls = 9", "balls = 1", "classes.stiff (line 19): its scene:"),
        ('"50 ms"', '"0 ms"', "duration (line 7): 0.0 was given"),
        ("[parameters]", "[sensor]\nresonance = 8\n[parameters]", "sensor.resonance (line 13): "),
        ('"10 deg"', '"10 kg"', "parameters.bearing.ball_angle (line 14): the unit"),
    ],
)  # fmt: skip
def test_faults_of_a_specification_are_told_with_their_place(tmp_path: Path, old: str, new: str, told: str) -> None:
    path = tmp_path / "set.toml"
    assert old in SPEC
    path.write_text(SPEC.replace(old, new).replace('title = "Tight and loose"', "title = 3"))
    with pytest.raises(BallpassError) as caught:
        read_spec(path)
    words = str(caught.value)
    assert words.count(told) == 1
    assert told in words
    assert "title (line 1)" in words  # with what else is wrong


@pytest.mark.long
def test_a_copy_of_a_specification_goes_on_and_another_seed_is_named_alone(tmp_path: Path) -> None:
    """The name of the file was compared as if it were the scene's content."""
    text = SPEC.replace('title = "Tight and loose"\n', "").replace("members = 40", "members = 2")
    text = text.replace("members = 60", "members = 2")
    target = str(tmp_path / "set.zarr")
    for name, one in (("set", text), ("copy", text), ("other", text.replace("seed = 7", "seed = 8"))):
        (tmp_path / f"{name}.toml").write_text(one, encoding="utf-8")
    done = [
        CliRunner().invoke(app, ["dataset", str(tmp_path / f"{name}.toml"), "--out", target])
        for name in ("set", "copy", "other")
    ]
    assert [one.exit_code for one in done] == [0, 0, 2], done[1].stderr
    assert "6 members, 0 made now" in done[1].stdout
    assert "another specification is there: title was 'set', and is 'other' now; seed was 7, and is 8 now." in (
        done[2].stderr
    )


def test_requests_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "set.toml"
    path.write_text(SPEC)
    for words, told in (
        (["--workers", "0"], "--workers: 0 was given"),
        (["--workers", "2", "--scheduler", "tcp://127.0.0.1:1"], "both given"),
    ):
        scene = str(ROOT / "scenes" / "varying_compliance.toml")
        for command in (["sweep", scene, "--vary", "bearing.clearance=1 um:2 um:3"], ["dataset", str(path)]):
            done = CliRunner().invoke(app, [*command, *words])
            assert done.exit_code == 2
            assert told in done.output.replace("\n", " ")


@pytest.mark.long
def test_a_set_that_does_not_fit_leaves_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("set.toml").write_text(SPEC.replace("10 kHz", "1e12 Hz"), encoding="utf-8")
    done = CliRunner().invoke(app, ["dataset", "set.toml"])
    assert done.exit_code == 2
    assert "would not fit into memory" in done.stderr
    assert not Path("results").exists()


@pytest.mark.long
def test_a_command_that_was_killed_is_taken_up_again(tmp_path: Path) -> None:
    """With a cluster and without one, and the numbers are those that nobody killed."""
    (tmp_path / "set.toml").write_text(SPEC.replace("members = 40", "members = 200\nchunk = 4"))
    command = [sys.executable, "-c", "from ballpass.runtime.app.entry import main; main()", "dataset", "set.toml"]

    def run(*words: str) -> str:
        done = subprocess.run([*command, *words], cwd=tmp_path, capture_output=True, text=True, check=True)
        return done.stdout

    whole = json.loads(run("--out", "whole.zarr", "--json"))
    assert whole.pop("units") == {"members": "1", "made": "1", "failures": "1"}
    assert whole == {"path": "whole.zarr", "members": 460, "made": 460, "failures": []}
    part = tmp_path / "results" / "set.zarr"
    with subprocess.Popen([*command, "--workers", "1"], cwd=tmp_path, stderr=subprocess.DEVNULL) as process:
        until = time.monotonic() + 60.0
        while len(list((part / "inner.ax").glob("[0-9]*.0"))) < 8 and time.monotonic() < until:
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
    kept = int(np.sum(xarray.open_zarr(part, chunks=None).status.values == 1))
    assert 0 < kept < 460
    time.sleep(1.0)  # its worker hears of it
    assert f"460 members, {460 - kept} made now, 0 without a signal" in run()
    with xarray.open_zarr(part, chunks=None) as one, xarray.open_zarr(tmp_path / "whole.zarr", chunks=None) as other:
        xarray.testing.assert_identical(one.load(), other.load())
    run("--out", "set.nc")
    with xarray.open_dataset(tmp_path / "set.nc") as netcdf:
        xarray.testing.assert_equal(netcdf.load(), one)


def envelope_features(path: Path, model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Peaks of the envelope's spectrum at characteristic lines and their first sidebands, kurtosis and crest factor."""
    with xarray.open_zarr(path, chunks=None) as found:
        t, signals, labels = found.time.values, found["inner.ay"].values.astype(float), found.label.values
        table, names = found.parameters.values, found.parameter.values.tolist()
    rows = []
    for signal_, numbers in zip(signals, table, strict=True):
        own = {name: value for name, value in zip(names, numbers, strict=True) if name in model.parameters}
        over = envelope(t, signal_, (500.0, 10e3))
        over -= over.mean()
        spectrum = np.abs(np.fft.rfft(over * np.hanning(len(over)))) / over.std()
        frequencies = np.fft.rfftfreq(len(over), t[1] - t[0])
        lines = characteristic_lines(model.manifest, own | model.constants(own))
        places = [k * line.frequency + n * line.side for line in lines for k in (1, 2, 3) for n in (-1, 0, 1)]
        told = diagnosis(signal_)
        peaks = [spectrum[np.abs(frequencies - place) <= 3.0].max(initial=0.0) for place in places]
        rows.append([*peaks, told.kurtosis, told.crest_factor])
    return np.array(rows), labels


@pytest.mark.long
def test_a_classifier_that_nobody_tuned_tells_four_classes_of_another_seed_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(ROOT / "scenes", tmp_path / "scenes")
    monkeypatch.chdir(tmp_path)
    spec = tmp_path / "scenes" / "data_sets" / "bearing_faults.toml"
    text = spec.read_text(encoding="utf-8")
    features = []
    for seed in (1, 2):
        spec.write_text(text.replace("seed = 1\n", f"seed = {seed}\n"))
        done = CliRunner().invoke(app, ["dataset", str(spec), "--out", f"{seed}.zarr"])
        assert done.exit_code == 0, done.output
        assert "100 members, 100 made now, 0 without a signal" in done.output
        features.append(envelope_features(tmp_path / f"{seed}.zarr", load("generated/bearing_faults_healthy")))
    (seen, labels), (unseen, truth) = features
    assert sorted(set(truth)) == ["ball", "healthy", "inner", "outer"]
    forest = RandomForestClassifier(random_state=0)
    assert forest.fit(seen, labels).score(unseen, truth) > 0.95
    # it is the labels that it learns from
    mixed = np.random.default_rng(1).permutation(labels)
    assert forest.fit(seen, mixed).score(unseen, truth) < 0.5
