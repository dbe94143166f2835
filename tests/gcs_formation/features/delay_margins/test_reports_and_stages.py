"""What is said of margins, and what stages make of it; vehicles are mere delays here."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from formation_scenario import load_scenario
from gcs_formation.errors import NotFiniteError
from gcs_formation.features.delay_margins.check_warnings import held_by_links, without_margins
from gcs_formation.features.delay_margins.margin_watch import CALM_LOOKS, HOLD_LOOKS
from gcs_formation.features.delay_margins.stages import DelayMargins, GainDesign
from gcs_formation.phases import Phase
from tests.flights.conftest import scenario
from tests.gcs_formation.features.delay_margins.test_margin_watch import NOW, Formation, Slow


def test_after_a_long_hold_it_follows_as_at_first_once_its_gains_are_the_scenarios_again() -> None:
    formation = Formation(on_delay="hold")
    for share, looks in ((1.2, HOLD_LOOKS + 1), (0.1, HOLD_LOOKS + CALM_LOOKS + 2)):
        for _ in range(looks):
            formation.use(share)
    assert min(formation.watch.bandwidth[1]) == 1.0
    before = len(formation.logged.of("gains"))
    assert before == 2
    assert formation.use(1.2) == pytest.approx(1.2)
    assert len(formation.logged.of("gains")) == before, "it is held again instead"
    assert formation.follower.identity in formation.watch.beyond


def test_while_it_follows_with_lower_gains_a_long_hold_is_said_once() -> None:
    formation = Formation(on_delay="hold")
    for _ in range(3 * HOLD_LOOKS):
        formation.use(1.2)
    said = [text for text in formation.logged.of("delay_margin", 2) if text.startswith("was held")]
    assert said == ["was held for 20 s by its delay: it follows with lower gains instead (on_delay: degrade)"]


def test_gains_are_stated_with_their_shares_the_delay_and_what_is_used_then() -> None:
    """A delay of 4 margins; after a change 0.7 of a margin is used, or less by a step of the bandwidth."""
    formation = Formation(on_delay="degrade")
    used = formation.use(4.0)
    (event,) = [each for each in formation.logged if each.kind == "gains"]
    shares = [event.details[f"bandwidth_{channel}"] for channel in ("speed", "heading", "height")]
    assert shares == formation.watch.bandwidth[1]
    words = ", ".join(f"{name} {share:.0%}" for name, share in zip(("speed", "heading", "height"), shares, strict=True))
    assert event.text == f"gains lowered; shares of the bandwidth: {words}"
    assert event.details["used"] == pytest.approx(used)
    assert 0.6 < used <= 0.7
    assert event.details["loop_delay_s"] == pytest.approx(formation.watch.longest_s)
    assert event.vehicle == 2


def test_an_axis_with_enough_of_its_margin_keeps_its_bandwidth() -> None:
    formation = Formation(on_delay="degrade")
    formation.use(0.95)
    shares = formation.watch.bandwidth[1]
    assert min(shares) < 1.0 == max(shares)


def test_a_loop_that_is_unstable_without_delay_has_no_margin() -> None:
    formation = Formation(type="pid", speed={"kp": 0.001, "ki": 50.0})
    assert math.isinf(formation.look())
    (said,) = formation.logged
    assert said.text == "has no delay margin: its loops are unstable whatever the delay"
    assert said.details["used"] is None
    assert math.isinf(formation.watch.max_used)


def test_one_that_has_led_is_reported_again_when_it_comes_near_its_margin_again() -> None:
    formation = Formation()
    formation.use(0.9)
    formation.look(formation.follower)
    formation.use(0.9)
    assert formation.logged.of("delay_margin", 2) == ["uses 90% of its delay margin"] * 2


@pytest.mark.parametrize(("off", "counts"), [(0.049, False), (0.051, True)])
def test_time_constants_that_are_five_percent_off_use_some_of_the_margin(off: float, counts: bool) -> None:
    used = list[float]()
    for each in (0.0, off):
        formation = Formation(delay_compensation=True)
        formation.delay(formation.follower, 0.2, sigma_s=0.01)
        for _ in range(4):
            formation.watch.check_loops(NOW, formation.leader, [[0.0, each]] * 3)
        used.append(formation.watch.used[1])
    assert (used[1] > used[0]) is counts


@pytest.mark.parametrize(("sigma_s", "named"), [(0.0, True), (0.4, False)])
def test_a_channel_is_named_where_its_time_constants_use_more_than_delay_does(sigma_s: float, named: bool) -> None:
    formation = Formation(delay_compensation=True)
    formation.delay(formation.follower, 0.2, sigma_s=sigma_s)
    for _ in range(4):
        formation.watch.check_loops(NOW, formation.leader, [[0.0, 0.0], [0.0, 0.0], [0.0, 3.0]])
    said = formation.logged[-1].text
    assert ("height doesn't follow as its model says" in formation.logged[0].text) or not named
    assert ("doesn't follow" in said) is (named or len(formation.logged) == 1)


def test_of_several_channels_the_one_that_uses_most_is_named() -> None:
    for errors, name in (((0.2, 3.0, 0.2), "heading"), ((3.0, 0.2, 0.2), "speed"), ((0.2, 0.2, 3.0), "height")):
        formation = Formation(delay_compensation=True)
        formation.delay(formation.follower, 0.2)
        formation.watch.check_loops(NOW, formation.leader, [[0.0, each] for each in errors])
        assert f": {name} doesn't follow" in formation.logged[0].text
        assert formation.logged[0].details["lags_off"] == 3.0


def test_without_prediction_wrong_time_constants_use_nothing() -> None:
    formation = Formation()
    formation.use(0.5)
    formation.watch.check_loops(NOW, formation.leader, [[0.0, 3.0]] * 3)
    assert formation.watch.used[1] == pytest.approx(0.5)


@pytest.mark.parametrize(("one_way_s", "designed"), [(0.049, False), (0.051, True)])
def test_gains_are_designed_for_50_ms_more_than_is_known_and_stated(one_way_s: float, designed: bool) -> None:
    slow = Slow()
    law = slow.look(one_way_s, begins=True)
    assert (law is not None) is designed
    if not designed:
        return
    assert law.design_delay_ms == pytest.approx(50.0), "whole hundredths of a second"
    details = dict(slow.logged[0].details)
    assert details.pop("design_delay_s") == pytest.approx(0.05)
    assert details.pop("disturbance_observer_radps") == law.disturbance_observer_radps
    assert details == {
        f"{channel}_{gain}": getattr(getattr(law, channel), gain)
        for channel in ("speed", "heading", "height")
        for gain in ("kp", "ki", "kd")
    }


@pytest.mark.parametrize(
    ("phase", "designed"),
    [(Phase.CONNECTING, False), (Phase.ASSEMBLING, True), (Phase.FLYING, True), (Phase.DONE, False)],
)
def test_gains_are_designed_in_flight_while_the_formation_is_commanded(phase: Phase, designed: bool) -> None:
    looked, findings = list[Any](), SimpleNamespace(tuned=None)
    watch: Any = SimpleNamespace(scenario="with other gains", check_loops=looked.append)
    cycle: Any = SimpleNamespace(flight=SimpleNamespace(phase=phase), now=NOW, findings=findings)
    GainDesign(watch).run(cycle)
    assert (looked, findings.tuned) == (([NOW], "with other gains") if designed else ([], None))


def test_a_law_that_fails_to_state_its_margins_is_the_cycles_first_fault() -> None:
    errors = [NotFiniteError(name, 1, "nan") for name in ("first", "second")]
    watch = SimpleNamespace(used=[0.1], bandwidth=[[1.0] * 3], holds=False, max_used=0.3, longest_s=0.7)
    waiting = iter(errors)

    def check_loops(*_: Any) -> None:
        watch.max_used = 0.4
        raise next(waiting)

    watch.check_loops = check_loops
    findings = SimpleNamespace(time_constants_off=[])
    cycle: Any = SimpleNamespace(
        findings=findings,
        controller=SimpleNamespace(fault=None),
        now=NOW,
        reconfiguration=SimpleNamespace(leader=None),
    )
    stage = DelayMargins(watch, cycle)  # type: ignore[arg-type]
    assert (findings.margin_used, findings.bandwidth, findings.max_used) == (watch.used, watch.bandwidth, 0.3)
    stage.run(cycle)
    stage.run(cycle)
    assert cycle.controller.fault is errors[0]
    assert (findings.max_used, findings.longest_s) == (0.4, 0.7)


def said(law: dict[str, Any], count: int = 3, **link: Any) -> list[str]:
    """Return what is said about followers that links will have held."""
    return list(
        held_by_links(
            load_scenario(scenario(vehicles={"count": count}, law={"on_delay": "hold"} | law, links={"default": link}))
        )
    )


def test_the_delay_at_which_eighty_percent_of_a_margin_is_in_use_is_where_followers_are_held() -> None:
    """What is enough is stated, of the loop: from both sides of 0.8 of it, and of the whole of it."""
    plain = {"delay_compensation": False}
    (text,) = said(plain, delay_ms=500)
    enough_s = float(text.partition("others; ")[2].partition(" s or less")[0])
    sampled_s = float(text.partition("delay is ")[2].partition(" s,")[0]) - 1.0

    def at(share: float) -> list[str]:
        return said(plain, delay_ms=500.0 * (share * enough_s - sampled_s))

    assert at(0.78) == []
    ((near,), (beyond,)) = at(0.82), at(1.02)
    assert "82% of what loop" in near
    assert "vehicle 2, 3 will be commanded to loiter now and then" in near
    assert "102% of what loop" in beyond
    assert "again and again" in beyond


def test_the_leader_is_held_only_by_a_mutual_law() -> None:
    (text,) = said({"type": "consensus", "delay_compensation": False}, 2, delay_ms=3000)
    assert "vehicle 1, 2 will be commanded to loiter" in text


def test_laws_with_margins_can_do_whatever_is_asked_for() -> None:
    for kind in ("pid", "consensus"):
        assert list(without_margins(load_scenario(scenario(law={"type": kind, "on_delay": "degrade"})))) == []
