"""Flies the documents' headline figures, and compares them with what the documents state, or writes them there.

python -m benchmarks.headlines                     # exit status 1 if a figure isn't the one that is stated
python -m benchmarks.headlines --page latency --write
"""

from __future__ import annotations

import math
import os
import sys
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from statistics import median

from benchmarks import parser, which_package
from benchmarks.headlines import Case, Found, fly, pages
from benchmarks.headlines.cases import CASES
from gcs_formation.studies.markdown import markdown

HEADS = ("figure", "flights", "median", "worst", "stated", "may be off by", "held")


def found_in(cases: Sequence[Case], processes: int) -> list[Found]:
    """Return the figures of cases, whose flights are flown in processes; NaN of one that couldn't be flown."""
    flights = [(case, number) for case in cases for number in range(case.count)]
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        results = [pool.submit(fly, *flight) for flight in flights]
    values = defaultdict[str, list[float]](list)
    for (case, _), result in zip(flights, results, strict=True):
        if isinstance(error := result.exception(), RuntimeError):
            print(f"{error}\n", file=sys.stderr)
        for name in case.figures:
            values[f"{case.name}.{name}"].append(math.nan if error else result.result()[name])
    return [
        Found(f"{case.name}.{name}", tuple(values[f"{case.name}.{name}"]), figure)
        for case in cases
        for name, figure in case.figures.items()
    ]


def row(found: Found, texts: Sequence[str]) -> list[str]:
    """Return a row of the table."""
    digits = found.figure.digits
    held = bool(texts) and all(map(found.agrees, texts))
    middle, off = f"{median(found.values):.{digits}f}", f"{found.tolerance:.{digits}f}"
    numbers = str(len(found.values)), middle, found.text, ", ".join(dict.fromkeys(texts)) or "nowhere", off
    return [found.name, *numbers, "yes" if held else "no"]


def main() -> int:
    """Fly, and compare or write."""
    parsing = parser(__doc__, page="only figures whose name begins with TEXT")
    parsing.set_defaults(processes=os.cpu_count() or 1)
    parsing.add_argument("--write", action="store_true", help="write the figures into the documents")
    given = parsing.parse_args()
    cases = [case for case in CASES if case.name.startswith(given.page)]
    if not cases:
        parsing.error(f"--page: found '{given.page}'; allowed: {', '.join(case.name for case in CASES)}")
    figures = found_in(cases, given.processes)
    if given.write:
        changed = [
            each.name for each in pages.documents() if pages.write(each, {fig.name: fig.text for fig in figures})
        ]
        print(f"written: {', '.join(changed) or 'nothing, all figures are as stated'}\n")
    texts = defaultdict[str, list[str]](list)
    for document in pages.documents():
        for name, text in pages.stated(document):
            texts[name].append(text)
    rows = [row(each, texts[each.name]) for each in figures]
    print(markdown(HEADS, rows))
    print(f"\n{which_package()}")
    return int(any(each[-1] == "no" for each in rows))


if __name__ == "__main__":
    sys.exit(main())
