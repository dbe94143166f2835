"""What a user is told during a flight."""

import io
import math

import pytest

from airlink.clock import Instant
from airlink.endpoint import VehicleId
from gcs_formation.app.progress import Progress, StatusLine, progress_on
from gcs_formation.recorder import Event

THREE = VehicleId(1, 3)


def told(*events: Event, mission_s: float = math.nan) -> list[str | None]:
    """Return the line printed for each event, None where there is none."""
    stream = io.StringIO()
    lines = Progress(stream)
    said: list[str | None] = []
    for event in events:
        before = stream.tell()
        lines.show_event(event, mission_s)
        said.append(stream.getvalue()[before:].removesuffix("\n") or None)
    return said


def test_phases_are_reported_with_their_cause_and_the_mission_time_once_there_is_one() -> None:
    begun = Event(Instant(71_500_000_000), "phase", "flying", None, {"cause": "the leader has passed the start"})
    assert told(begun) == ["start +   71.5 s  flying: the leader has passed the start"]
    assert told(begun, mission_s=0.0) == ["t     =    0.0 s  flying: the leader has passed the start"]


@pytest.mark.parametrize(("kind", "usual", "unusual"), [("link", "connected", "lost"), ("member", "starting", "x")])
def test_usual_events_of_a_start_are_reported_only_after_trouble(kind: str, usual: str, unusual: str) -> None:
    well, ill = Event(Instant(0), kind, usual, THREE), Event(Instant(0), kind, unusual, THREE)
    other = Event(Instant(0), kind, usual, VehicleId(1, 4))
    lines = told(well, ill, other, well, well)
    assert [line is not None for line in lines] == [False, True, False, True, False]
    assert lines[1] == f"start +    0.0 s  vehicle 3, {kind}: {unusual}"


def test_chatter_is_for_the_record_alone() -> None:
    kinds = (("mode", "GUIDED"), ("statustext", "Throttle armed"), ("ready", "in the air"), ("link", "stale"))
    assert set(told(*(Event(Instant(0), kind, text, THREE) for kind, text in kinds))) == {None}


def test_a_log_whose_reader_has_gone_ends_no_flight() -> None:
    stream = io.StringIO()
    lines = progress_on(stream)
    assert not isinstance(lines, StatusLine)
    lines.show_event(Event(Instant(0), "failure", "the disk is full"), 1.0)
    assert stream.getvalue() == "t     =    1.0 s  failure: the disk is full\n"
    stream.close()
    lines.show_event(Event(Instant(0), "failure", "the disk is full"), 1.0)
    assert type(progress_on(None)) is Progress
