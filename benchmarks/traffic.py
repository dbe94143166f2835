"""Bytes that a flight of the quickstart puts on its links, by message, up and down: docs/links.md.

python -m benchmarks.traffic
python -m benchmarks.traffic configs/px4.yaml --set "links.channels=[{vehicles: all, rate_kbps: 57.6}]"
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import gcs_formation
from airlink.messages import KINDS
from airlink.stream_parser import StreamParser
from gcs_formation.record.tlog import read_tlog
from gcs_formation.studies.markdown import markdown

QUICKSTART = Path(__file__).parents[1] / "configs" / "quickstart.yaml"
MICRO = 1e-6


def traffic(log: Path, station: int) -> tuple[Counter[tuple[bool, str]], Counter[tuple[bool, str]], float]:
    """Return a log's frames and bytes by direction (whether up) and message, and its duration, s."""
    frames, octets, first, last = Counter[tuple[bool, str]](), Counter[tuple[bool, str]](), 0, 0
    parser = StreamParser()
    for stamp_us, raw in read_tlog(log):
        first, last = first or stamp_us, stamp_us
        for frame in parser.feed(raw):
            kind = KINDS.get(frame.message_id)
            key = frame.system == station, kind.name if kind else str(frame.message_id)
            frames[key] += 1
            octets[key] += len(raw)
    return frames, octets, (last - first) * MICRO


def main() -> None:
    """Fly, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", nargs="?", default=str(QUICKSTART))
    parser.add_argument("--set", action="append", default=[], dest="overrides")
    given = parser.parse_args()
    overrides = dict(each.split("=", 1) for each in given.overrides)
    with TemporaryDirectory() as out:
        summary = gcs_formation.run(given.scenario, clock="virtual", out=Path(out) / "run", overrides=overrides)
        frames, octets, seconds = traffic(Path(out) / "run" / "flight.tlog", 255)
    rows = [
        ["up" if up else "down", name, f"{frames[up, name] / seconds:.1f}", f"{count / seconds:.0f}", f"{count}"]
        for (up, name), count in octets.most_common()
    ]
    print(markdown(("direction", "message", "a second", "bytes a second", "bytes"), rows))
    for up in (True, False):
        total = sum(count for (upwards, _), count in octets.items() if upwards == up)
        print(f"{'up' if up else 'down'}: {total} bytes, {total / seconds:.0f} a second")
    for number, each in summary.to_dict()["followers"].items():
        print(f"vehicle {number}: RMS {each['error_x_m']['rms']:.4f}, {each['error_y_m']['rms']:.4f} m")


if __name__ == "__main__":
    main()
