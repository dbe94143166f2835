"""What the commands' help ends with: examples, orders."""

from __future__ import annotations


def _examples(*lines: str) -> str:
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


ALL = _examples(
    "gcs-formation init                                           writes quickstart.yaml",
    "gcs-formation check quickstart.yaml",
    "gcs-formation run quickstart.yaml --speedup 5 --out runs/quickstart",
    "gcs-formation run quickstart.yaml --clock virtual --set links.default.delay_ms=300",
    "gcs-formation tell runs/quickstart shape line                to a flight under way",
    "gcs-formation report runs/quickstart",
    "gcs-formation compare quickstart.yaml --laws pid,fuzzy_pid   on one seed, side by side",
)
INIT = _examples(
    "gcs-formation init                      quickstart.yaml, here",
    "gcs-formation init try --example paper  try/paper.yaml",
)
RUN = _examples(
    "gcs-formation run quickstart.yaml --speedup 5 --out runs/quickstart",
    "gcs-formation run quickstart.yaml --clock virtual --until 60 --json",
    'gcs-formation run quickstart.yaml --clock virtual --set formation.shape=arrow --set "wind.velocity_mps=[3, 0, 0]"',
)
FLY = _examples(
    "sim-vehicles quickstart.yaml                              vehicles, in another terminal",
    "gcs-formation fly quickstart.yaml --out runs/flown",
    "gcs-formation fly arduplane.yaml --dry-run                says what it would send, and arms nobody",
    "gcs-formation fly --resume runs/flown                     takes over what flies of a run that was killed",
    "gcs-formation fly arduplane.yaml --confirm                asks before anybody is armed",
)
CHECK = _examples(
    "gcs-formation check quickstart.yaml",
    "gcs-formation check quickstart.yaml --set law.rate_hz=5 --json",
)
TELL = (
    _examples(
        "gcs-formation tell runs/quickstart status",
        "gcs-formation tell runs/quickstart shape line",
        "gcs-formation tell runs/quickstart leader 2",
    )
    + """

\b
Orders:
  shape NAME [SPACING_M]   fly another shape
  spacing SPACING_M        fly the same shape wider or closer
  speed MPS                fly the path at another speed
  heading DEG              multirotors that stand: turn on the spot
  leader ID                let another vehicle lead
  loiter | rtl | land      end the flight: circle here, at home, or land there

\b
Or:
  status                   a page on phase, vehicles, errors, delays and margins

Exit status 1: refused, with the reason. 3: no flight answers there.
"""
)
IDENTIFY = _examples(
    "gcs-formation identify arduplane.yaml --out skywalker.yaml   flies steps, then fits",
    "gcs-formation identify runs/flown --vehicle 2                from what was recorded",
    "gcs-formation identify 00000042.BIN --out skywalker.yaml     an ArduPilot log, or a .tlog",
)
REPORT = _examples("gcs-formation report runs/quickstart      writes runs/quickstart/report.html")
COMPARE = _examples(
    "gcs-formation compare paper.yaml --laws pid,fuzzy_pid,consensus --from 500 --jobs 2 --out runs/laws",
    "gcs-formation compare quickstart.yaml --laws fuzzy_pid,fuzzy_pid_uncompensated --set links.default.delay_ms=300",
)
SCHEMA = _examples(
    "gcs-formation schema > scenario.schema.json",
    "gcs-formation schema --markdown | less",
)
STRESS = _examples(
    "gcs-formation stress --count 100",
    "gcs-formation stress --hard --count 200",
    "gcs-formation stress --count 1 --seed 17 --out runs/seed-17",
)
STUDY = _examples(
    "gcs-formation study delay-by-loss.yaml --out studies/delay-by-loss",
    "gcs-formation study delay-by-loss.yaml --out studies/delay-by-loss --resume",
    "gcs-formation study delay-by-loss.yaml --out studies/cluster --scheduler tcp://10.0.0.1:8786",
    "gcs-formation study fly studies/delay-by-loss 17      that flight again, with its whole record",
)
