"""Columns of files: each layout is read as what it means, or refused with what to do."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import h5netcdf
import numpy as np
import pytest

from ballpass.runtime import RequestError
from ballpass.runtime.contract.column_files import read_columns

TIMES, PLACES = np.array([0.0, 0.5, 1.5, 2.25]), np.array([1.5, -2.25, 3.5, 0.75])
STYLES = {"[]": "{} [{}]", "()": "{} ({})", "_": "{}_{}", "none": "{}"}


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
def test_each_layout_of_a_csv_file_is_read_as_it_means_or_refused(separator: str, tmp_path: Path) -> None:
    path, read = tmp_path / "probe.csv", 0
    kinds = product((".", ","), STYLES, ("one", "two", "none"), ("", "\ufeff"), ("\n", "\r\n"), ("s", "ms", "count"))
    for point, style, heads, mark, end, unit in kinds:
        units = (unit, "um") if unit != "count" else ("", "um")
        names = ("time", "probe") if unit != "count" else ("count", "probe")
        styled = [STYLES[style].format(name, one) if one else name for name, one in zip(names, units, strict=True)]
        lines = {"one": [styled], "two": [names, units], "none": []}[heads]
        rows = [[f"{number}".replace(".", point) for number in row] for row in zip(TIMES, PLACES, strict=True)]
        path.write_text(
            mark + end.join(separator.join(row) for row in [*lines, *rows]) + end, encoding="utf-8", newline=""
        )
        case = (separator, point, style, heads, mark, end, unit)
        if separator == " " and heads == "two" and unit == "count":  # blanks leave no cell empty
            continue
        if separator == point:
            with pytest.raises(RequestError, match="names"):
                read_columns(path)
            continue
        file = read_columns(path)
        said = heads == "two" or (heads == "one" and style != "none")
        probe = file.column("probe" if heads != "none" else "2")
        factor = 1e-6 if said else 1.0
        assert file.si(probe, "m") == pytest.approx(factor * PLACES, rel=1e-14), case
        if heads == "none" or unit == "count":
            with pytest.raises(RequestError, match=r"--time.*--rate"):
                file.time()
            assert file.time(rate=4.0) == pytest.approx(np.arange(4) / 4.0)
        else:
            assert file.time() == pytest.approx(TIMES * (1e-3 if said and unit == "ms" else 1.0), rel=1e-14), case
        read += 1
    assert read > 60


def test_packed_netcdf_is_read_by_the_cf_conventions(tmp_path: Path) -> None:
    packed = np.array([0, 13180, 7, -32768], dtype=np.int16)
    with h5netcdf.File(tmp_path / "force.nc", "w") as file:
        file.dimensions["row"] = 4
        force = file.create_variable("force", ("row",), "i2", data=packed)
        force.attrs.update({"scale_factor": 0.02, "add_offset": 1.0, "_FillValue": np.int16(7), "unit": "kN"})
        file.create_variable("time", ("row",), float, data=TIMES).attrs["units"] = "milliseconds"
    found = read_columns(tmp_path / "force.nc")
    expected = [1e3, 264.6e3, np.nan, -654.36e3]
    assert found.si(found.column("force"), "N") == pytest.approx(expected, rel=1e-12, nan_ok=True)
    assert found.time() == pytest.approx(1e-3 * TIMES, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,x,x\n0,1,2\n1,2,3\n", "more than once"),
        ("time,x\n0,1.72 um\n1,2\n2,3\n", "neither names nor numbers"),
        ("t;x\n0,5;1.5\n1,5;2.5\n", "decimal commas"),
        ("time,x\n0,1\n1\n2,3\n3,4\n5,6\n", "line 3 .* another number of cells"),
        ("0,1\n1,2\n", "no line of names"),
        ("t," + "x" * 200_000 + "\n0,1\n", "is no table"),
        ("", "no column of numbers"),
        ("time,x (furlong)\n0,1\n1,2\n", "furlong"),
    ],
)
def test_what_a_file_leaves_open_is_refused(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "probe.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RequestError, match=words):
        (file := read_columns(path)).si(file.column("x"), "m")


def test_no_mutation_of_a_csv_file_ends_in_a_traceback(tmp_path: Path) -> None:
    whole = b"# made here\nDevice;X2\ntime [ms];inner.y (um)\n" + b"".join(
        b"%d,5;%d,25\n" % (k, k * k) for k in range(20)
    )
    path, random = tmp_path / "probe.csv", np.random.default_rng(0)
    for _ in range(1000):
        content = bytearray(whole[: random.integers(len(whole))] if random.integers(4) == 0 else whole)
        for _ in range(random.integers(1, 6) if content else 0):
            content[random.integers(len(content))] = random.integers(256)
        path.write_bytes(bytes(content))
        try:
            file = read_columns(path)
            file.time()
            [file.numbers(one) for one in file.columns]
        except RequestError:
            pass
