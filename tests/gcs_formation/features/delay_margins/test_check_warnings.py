"""What `check` says of links that will have followers held."""

from __future__ import annotations

from typing import Any

from formation_scenario import load_scenario
from gcs_formation.app.check import check_report
from gcs_formation.features.delay_margins.check_warnings import held_by_links
from tests.flights.conftest import scenario as flight


def held(**keys: Any) -> str | None:
    """Return what is said about a formation that is held because of its links."""
    law = {"on_delay": "hold"} | keys.pop("law", {})
    return next(held_by_links(load_scenario(flight(law=law, links={"default": keys}))), None)


def test_jitter_for_which_followers_are_held_again_and_again_is_named_with_what_would_be_enough() -> None:
    said = held(delay_ms=300, jitter_ms=60)
    assert said is not None
    assert "round trips scatter by 85 ms" in said
    assert "again and again" in said
    enough_ms = float(said.partition("about")[2].partition("others; ")[2].partition(" ms")[0])
    assert held(delay_ms=300, jitter_ms=1.05 * enough_ms / 2**0.5) is not None
    assert held(delay_ms=300, jitter_ms=0.7 * enough_ms / 2**0.5) is None
    assert held(delay_ms=300, jitter_ms=60, law={"on_delay": "warn"}) is None


def test_a_delay_for_which_followers_are_held_without_prediction_is_named() -> None:
    said = held(delay_ms=500, law={"delay_compensation": False})
    assert said is not None
    assert "the loop's delay is 1.100 s" in said
    assert "law.delay_compensation predicts over it" in said


def test_jitter_that_comes_in_flight_holds_too() -> None:
    change = {"at_s": 30, "jitter_ms": 120}
    keys = {"law": {"on_delay": "hold"}, "links": {"default": {"delay_ms": 400}, "changes": [change]}}
    (said,) = held_by_links(load_scenario(flight(**keys)))
    assert "from 30 s on" in said


def test_check_says_it() -> None:
    planned = load_scenario(flight(law={"on_delay": "hold"}, links={"default": {"delay_ms": 300, "jitter_ms": 60}}))
    assert set(held_by_links(planned)) <= set(check_report(planned)["warnings"])
