"""What `check` says of vehicles with a dead time."""

from __future__ import annotations

from typing import Any

import pytest

from formation_scenario import Scenario, load_scenario
from gcs_formation.app.check import tau_margins
from gcs_formation.app.check_warnings import warnings
from gcs_formation.stability import law_margins
from tests.flights.conftest import scenario


def late(dead_s: float, **law: Any) -> Scenario:
    vehicles = {"count": 2, "model": {"dead_time_s": dead_s}}
    return load_scenario(scenario(vehicles=vehicles, law={"type": "fuzzy_pid", **law}))


def said(planned: Scenario) -> list[str]:
    return [each for each in warnings(planned, law_margins(planned), tau_margins(planned)[0]) if "loop x" in each]


def test_a_dead_time_beyond_the_margin_is_said_only_where_nothing_predicts_over_it() -> None:
    """The x loop bears 0.87 s."""
    (text,) = said(late(1.0, delay_compensation=False))
    assert text == "loop x is unstable by a dead time of 1 s alone, without any delay of the link"
    assert not any("unstable" in each for each in said(late(1.0)))
    assert said(late(0.3)) == []


def test_prediction_bears_less_of_wrong_time_constants_the_longer_the_dead_time() -> None:
    without, shares = tau_margins(late(0.0))[0], tau_margins(late(0.6))[0]
    assert 0.0 < shares["x"] < without["x"]
    assert shares["x"] == pytest.approx(tau_margins(linked(300))[0]["x"])


def linked(delay_ms: float) -> Scenario:
    links = {"default": {"delay_ms": delay_ms}}
    return load_scenario(scenario(vehicles={"count": 2}, law={"type": "fuzzy_pid"}, links=links))
