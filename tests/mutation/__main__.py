"""Draw mutants of a package, run its own tests on each, and print those that no test fails on."""

import argparse
import os
import random
import sys
from pathlib import Path

from airlink.cli import calculate_in_one_thread
from tests.mutation.mutant import mutants
from tests.mutation.runs import run


def main() -> None:
    """Print the mutants that live, and their number."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("package", type=Path, help="folder or file whose modules get the faults")
    parser.add_argument("--tests", type=Path, nargs="+", help="by default the folder of the same name below tests/")
    parser.add_argument("-m", dest="marked", default="not slow", help="which of the tests, as for pytest")
    parser.add_argument("--count", type=int, default=200, help="mutants to draw (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the draw (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes at once")
    parser.add_argument("--again", type=Path, metavar="FILE", help="only those that an earlier run's output says live")
    options = parser.parse_args()
    if not options.package.exists():
        parser.error(f"found nothing at {options.package}; allowed: a folder or file of the project, from its top")
    calculate_in_one_thread()
    below = options.tests or [Path("tests") / options.package.with_suffix("")]
    tests = [file for each in below for file in ([each] if each.is_file() else sorted(each.rglob("test_*.py")))]
    every = mutants(options.package)
    drawn = random.Random(options.seed).sample(every, min(options.count, len(every)))
    if options.again:
        lived = set(options.again.read_text().splitlines())
        drawn = [mutant for mutant in every if str(mutant) in lived]
    alive = 0
    for i, (mutant, lives) in enumerate(run(drawn, tests, options.marked, options.jobs), 1):
        alive += lives
        if lives:
            print(mutant, flush=True)
        if sys.stderr.isatty():
            print(f"\r{i} of {len(drawn)}, {alive} alive", end="\r", file=sys.stderr)
    print(f"{options.package}: {alive} of {len(drawn)} alive; {len(every)} mutants in all")


if __name__ == "__main__":
    main()
