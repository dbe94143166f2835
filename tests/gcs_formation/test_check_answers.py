"""What `check` predicts for loops with losses, slow laws and unpaired states, against flights."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest

from formation_scenario import Scenario, load_scenario
from gcs_formation.app.check import check_report
from gcs_formation.app.check_law import of_different_instants, slow_answer
from gcs_formation.app.loop_delays import configured_loop_delay_s

PATH = {"speed_mps": 22, "waypoints_m": [[0, 0, 100], [900, 0, 100], [4200, 0, 100]]}


def planned(*overrides: str, count: int = 4, **keys: Any) -> Scenario:
    """Return a scenario on a straight path."""
    return load_scenario({"vehicles": {"count": count}, "path": PATH} | keys, overrides)


@pytest.mark.parametrize(("loss", "told"), [(0.0, False), (0.15, True)])
def test_lost_setpoints_are_reckoned_with_as_longer_holds(loss: float, told: bool) -> None:
    """Seven in a star at 2 Hz: setpoints are held for (1 + 0.15)/(1 - 0.15)/2 ticks; in flight they swung by 6 m."""
    scenario = planned("law.type=consensus", "law.rate_hz=2", f"links.default.loss={loss}", count=7)
    found = [each for each in check_report(scenario)["warnings"] if "no prediction makes up for that" in each]
    assert bool(found) == told
    if told:
        assert "held for 0.338 s on average (15% of them are lost), 89% of its margin 0.379 s" in found[0]
        (enough,) = re.findall(r"law.rate_hz of ([\d.]+) or more", found[0])
        faster = planned("law.type=consensus", f"law.rate_hz={enough}", f"links.default.loss={loss}", count=7)
        assert not [each for each in check_report(faster)["warnings"] if "no prediction" in each]


def test_losses_count_as_delay_where_nothing_is_predicted() -> None:
    without, lossy = (planned("law.delay_compensation=false", f"links.default.loss={loss}") for loss in (0.0, 0.5))
    assert configured_loop_delay_s(without, lossy=True) == pytest.approx(configured_loop_delay_s(without))
    assert configured_loop_delay_s(without) == pytest.approx(0.1)
    assert configured_loop_delay_s(lossy, lossy=True) == pytest.approx(0.3)  # in both directions 1.5/0.5 times as long
    slow = planned("law.delay_compensation=false", "links.default={delay_ms: 300, loss: 0.3}")
    assert any("losses included" in each for each in check_report(slow)["warnings"])


def test_a_protocol_that_hardly_answers_is_told_with_what_is_left_and_what_is_faster() -> None:
    """Seven ArduPlanes in a star at 2 Hz: k1 is the smallest that is tried. In flight they were up to 26 m off."""
    keys: dict[str, Any] = {"vehicles": {"count": 7, "autopilot": "arduplane"}, "law": {"type": "consensus"}}
    scenario = planned("law.rate_hz=2", "links.default.delay_ms=500", "duration_s=100", **keys)
    said = slow_answer(scenario)
    assert said is not None
    assert said in check_report(scenario)["warnings"]
    k1 = scenario.law.consensus.k1
    time_s = 2.0 / (1.0 - math.sqrt(1.0 - 4.0 * k1))  # for the mode s^2 + s + k1
    assert f"found k1 {k1:.2g}: errors take {time_s:.0f} s" in said
    assert "of an error 65% is left when the flight is over at 100 s" in said
    assert "at law.rate_hz 2 and links of 500 ms each way; law.type of pid takes 6 s" in said
    keys["law"] = {"type": "pid"}
    assert slow_answer(planned("law.rate_hz=2", "links.default.delay_ms=500", **keys)) is None


def test_a_protocol_that_a_higher_rate_makes_faster_is_told_so() -> None:
    keys: dict[str, Any] = {"vehicles": {"count": 3, "autopilot": "arduplane"}, "law": {"type": "consensus"}}
    assert "; law.rate_hz of 5.0 takes 16 s" in str(slow_answer(planned("law.rate_hz=2", **keys)))
    assert slow_answer(planned("law.rate_hz=5", **keys)) is None
    assert slow_answer(planned("law.type=consensus", "law.rate_hz=2", count=7)) is None


@pytest.mark.parametrize(("rate_hz", "loss", "apart_m"), [(2, 0.0, 4.5), (2, 0.05, 5.8), (4, 0.15, 4.2), (10, 0.05, 0)])
def test_states_of_different_instants_are_told_where_nothing_is_predicted(
    rate_hz: float, loss: float, apart_m: float
) -> None:
    """Without loss two ages, uniform in a period, differ by 1/sqrt(6) of it: 4.5 m at 22 m/s and 2 Hz."""
    keys = "law.delay_compensation=false", f"links.default.loss={loss}"
    scenario = planned(*keys, f"telemetry.rate_hz={rate_hz}")
    said = of_different_instants(scenario)
    assert (said is not None) == (apart_m > 0)
    if said:
        assert said in check_report(scenario)["warnings"]
        assert f"which looks like {apart_m:g} m along the path at 22 m/s" in said
        (enough,) = re.findall(r"telemetry.rate_hz of ([\d.]+) or more", said)
        assert of_different_instants(planned(*keys, f"telemetry.rate_hz={enough}")) is None


def test_predicted_states_are_of_one_instant_and_so_are_those_of_the_consensus() -> None:
    assert of_different_instants(planned("telemetry.rate_hz=2")) is None
    assert (
        of_different_instants(planned("law={type: consensus, delay_compensation: false}", "telemetry.rate_hz=2"))
        is None
    )


@pytest.mark.parametrize("key", ["outage=true", "loss=1"])
def test_links_that_nothing_comes_over_are_told(key: str) -> None:
    scenario = planned(f"links.default.{key}", start={"in_air": True})
    found = [each for each in check_report(scenario)["warnings"] if "nothing comes over" in each]
    assert found == ["links: nothing comes over that of vehicle 1, 2, 3, 4 at the start: the formation can't assemble"]


def test_a_rate_that_no_law_has_is_not_said_to_be_enough() -> None:
    scenario = planned("law={type: consensus, consensus: {k1: 1.0e+6}}")
    (said,) = [each for each in check_report(scenario)["warnings"] if "no prediction" in each]
    assert said.endswith("no prediction makes up for that, lower gains do")
