"""Throughput of data sets: this process alone, and the workers of a Dask cluster on this machine.

``python -m benchmarks.data_sets [--members N] [--rounds N] [--page FILE]``; takes two minutes with the defaults.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import psutil

from ballpass.derive import generate, read_scene
from ballpass.runtime import Distribution, SignalClass, Signals, load, make_data_set
from ballpass.runtime.many.cluster import connected
from benchmarks.problem import ROOT

SIGNALS = Signals(
    outputs=("inner.ax",), sample_rate=25.6e3, duration=1.0, transient=0.1, snr=20.0, rtol=1e-6, precision="float32"
)
#: Ways to make them, by the number of workers.
WAYS = {"this process, no Dask": None, "1 worker": 1, "2 workers": 2}
PAGE = ROOT / "docs" / "howto" / "data_set_numbers.md"


def measure(members: int, rounds: int) -> dict[str, Any]:
    """Signals a second of each way, best of interleaved rounds, and processor time of a signal."""
    best: dict[str, list[float]] = {}
    load_average = psutil.getloadavg()[0]
    with tempfile.TemporaryDirectory() as place:
        scene = read_scene(ROOT / "scenes" / "rotor.toml", changes={"run": {"outputs": list(SIGNALS.outputs)}})
        model = load(generate(scene, Path(place) / "rotor"))
        speed = Distribution(name="uniform", arguments={"loc": 250.0, "scale": 130.0})
        classes = [SignalClass(label="rotor", model=model, members=members, parameters={"shaft.speed": speed})]
        few = [SignalClass(label="rotor", model=model, members=16, parameters={"shaft.speed": speed})]
        for number in range(rounds):
            for way, workers in WAYS.items():
                with connected(None, workers) as client:
                    make_data_set(Path(place) / f"{way} {number}", few, SIGNALS, seed=1, client=client)  # loads
                    begun, used = time.perf_counter(), _processor_time()
                    target = Path(place) / f"{way} {number}.zarr"
                    report = make_data_set(target, classes, SIGNALS, seed=1, client=client)
                    taken, used = time.perf_counter() - begun, _processor_time() - used
                if report.failures:
                    raise RuntimeError(f"{len(report.failures)} members failed: {report.failures[0]}")
                found = best.setdefault(way, [0.0, float("inf")])
                best[way] = [max(found[0], members / taken), min(found[1], used / members)]
    return {"members": members, "rounds": rounds, "load": load_average, "ways": best}


def _processor_time() -> float:
    """Of this process and its workers [s]."""
    own = psutil.Process()
    times = [process.cpu_times() for process in (own, *own.children(recursive=True))]
    return float(sum(one.user + one.system for one in times))


def page(result: dict[str, Any]) -> str:
    """The table of the page."""
    base = result["ways"][next(iter(WAYS))]
    lines = [
        f"<!-- Written by `python -m benchmarks.data_sets --members {result['members']} --rounds {result['rounds']}`. "
        "Do not edit. -->",
        "",
        f"{result['members']} signals of 1 s at 25.6 kHz of `scenes/rotor.toml`, on {psutil.cpu_count()} processors, "
        f"best of {result['rounds']}. When it began, programs wanted {result['load']:.1f} processors: where it is more "
        "than there are, rates mean little, and processor times more.",
        "",
        "| made by | signals a second | beside one process | processor time of a signal | 10 000 signals |",
        "| --- | ---: | ---: | ---: | ---: |",
    ]
    for way, (rate, used) in result["ways"].items():
        lines.append(
            f"| {way} | {rate:.3g} | {rate / base[0]:.2f} | {1e3 * used:.3g} ms | {1e4 / rate / 60.0:.2g} min |"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.data_sets", description=__doc__)
    parser.add_argument("--members", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--page", type=Path, default=PAGE)
    options = parser.parse_args()
    text = page(measure(options.members, options.rounds))
    options.page.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
