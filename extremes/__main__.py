"""Run the tour and write its page: ``python -m extremes [--quick] [--list-only] [WORD ...]``.

With words, or ``--quick``, only some cases run, and the page is written to build/extremes.
"""

from __future__ import annotations

import argparse
import sys
import time

from extremes import report, sanitized
from extremes.case import Row, run_case, select
from extremes.models import ROOT
from extremes.tour import cases


def main(arguments: list[str] | None = None) -> int:
    """Run what is asked for; 0 when every case holds."""
    parser = argparse.ArgumentParser(prog="python -m extremes", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the cases of the test suite only")
    parser.add_argument("--list-only", action="store_true", help="write no page")
    parser.add_argument("words", nargs="*", metavar="WORD", help="cases whose section or name has one of the words")
    options = parser.parse_args(arguments)
    started = time.perf_counter()
    rows: list[Row] = []
    chosen = [case for case in select(cases(), options.words) if case.quick or not options.quick]
    if any(case.method == sanitized.METHOD and sanitized.BESIDE in case.name for case in chosen):
        sanitized.started()
    for case in chosen:
        row = run_case(case)
        rows.append(row)
        print(_line(row), file=sys.stdout if options.list_only else sys.stderr, flush=True)
    seconds = time.perf_counter() - started
    whole = not (options.quick or options.words)
    if not options.list_only:
        page = (ROOT / "docs" if whole else ROOT / "build" / "extremes") / "extremes.md"
        report.write(rows, page, seconds)
        print(page.relative_to(ROOT))
    failed = [row for row in rows if not row.holds]
    for row in failed:
        print(f"\n{row.case.group}: {row.case.name}, {row.case.method}\n{row.fault}", file=sys.stderr)
    return 1 if failed or not rows else 0


def _line(row: Row) -> str:
    mark = "ok  " if row.holds else "FAIL"
    found = row.finding
    error = f"{found.error:.2g} of {found.bound:.2g}" if found and found.error is not None else ""
    status = found.status if found else "fault"
    return f"{mark} {row.seconds:7.2f} s  {row.case.group}: {row.case.name}, {row.case.method}: {status} {error}"


if __name__ == "__main__":
    sys.exit(main())
