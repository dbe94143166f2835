"""Consequences of measured delays: events, lower gains, loitering; vehicles are mere delays here."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from airlink.clock import NANOSECONDS, Instant, after
from airlink.endpoint import VehicleId
from formation_scenario import load_scenario
from gcs_formation.features.delay_margins.margin_watch import (
    CALM_LOOKS,
    CLEAR,
    DEGRADE,
    HOLD_LOOKS,
    LASTING_LOOKS,
    RESTORE,
    SLOW_LOOKS,
    DesignWatch,
    MarginWatch,
)
from gcs_formation.features.delay_margins.stages import DelayMargins, FirstGainDesign
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.stability.mismatch import NEAR
from tests.flights.conftest import scenario
from tests.gcs_formation.event_log import EventLog

NOW = Instant(0)
NONE_OFF = [[0.0] * 2] * 3


class Formation:
    """A leader and a follower over links with the same delay up and down, without prediction."""

    def __init__(self, count: int = 2, **law: Any) -> None:
        keys = scenario(vehicles={"count": count}, law={"type": "fuzzy_pid", "delay_compensation": False, **law})
        self.vehicles: dict[VehicleId, Any] = {
            VehicleId(1, 1 + index): SimpleNamespace(identity=VehicleId(1, 1 + index), index=index)
            for index in range(count)
        }
        self.leader, self.follower, *_ = self.vehicles.values()
        self.logged = EventLog()
        self.scenario = load_scenario(keys)
        self.watch = MarginWatch(self.scenario, self.vehicles, self.logged)
        for each in self.vehicles.values():
            self.delay(each, 0.0)

    def delay(self, vehicle: Any, one_way_s: float, sigma_s: float = 0.0) -> None:
        vehicle.clock = SimpleNamespace(one_way_s=one_way_s, usual_jitter_s=sigma_s)
        vehicle.round_trips = SimpleNamespace(down_s=one_way_s)

    def look(self, leader: Any = None) -> float:
        """Look once; return the follower's share of the margin in use."""
        time_constants_off = [[0.0] * len(self.vehicles)] * 3
        self.watch.check_loops(NOW, self.leader if leader is None else leader, time_constants_off)
        return float(self.watch.used[1])

    def use(self, share: float) -> float:
        """Give the follower's link the delay that uses a share of the margin at full gains, and look."""
        full = self.full
        self.delay(self.follower, (share - full[0]) / full[1])
        return self.look()

    @property
    def full(self) -> tuple[float, float]:
        """Return the share used without delay, and its increase per second of delay each way, which is constant."""
        if not hasattr(self, "_full"):
            fresh = MarginWatch(self.scenario, self.vehicles, EventLog())
            used: list[float] = []
            for one_way_s in (0.0, 0.1):
                self.delay(self.follower, one_way_s)
                fresh.check_loops(NOW, self.leader, NONE_OFF)
                used.append(float(fresh.used[1]))
            self._full = used[0], (used[1] - used[0]) / 0.1
        return self._full


@pytest.fixture(scope="module")
def warning() -> Formation:
    return Formation()


def test_the_share_in_use_is_the_loop_s_delay_over_its_margin(warning: Formation) -> None:
    assert warning.use(0.5) == pytest.approx(0.5)
    assert math.isnan(warning.watch.used[0]), "the leader has no loop around it"
    longest_s = warning.watch.longest_s
    assert warning.use(1.3) == pytest.approx(1.3)
    assert warning.watch.longest_s > longest_s
    assert warning.watch.max_used == pytest.approx(1.3)
    longest_s = warning.watch.longest_s
    warning.use(0.4)
    assert (warning.watch.max_used, warning.watch.longest_s) == (pytest.approx(1.3), longest_s)


def test_the_loop_s_delay_is_the_way_up_and_the_way_down_however_the_round_trip_is_split(warning: Formation) -> None:
    used: list[float] = []
    for down_s in (0.05, 0.1, 0.15):
        warning.delay(warning.follower, 0.1)
        warning.follower.round_trips.down_s = down_s
        used.append(warning.look())
    assert used == pytest.approx([used[0]] * 3)
    begun = Formation()
    begun.look()
    before_s = begun.watch.longest_s
    begun.delay(begun.follower, 0.1)
    begun.look()
    assert begun.watch.longest_s - before_s == pytest.approx(0.2)


def test_a_delay_that_is_not_known_yet_is_no_share_and_no_event() -> None:
    formation = Formation()
    formation.delay(formation.follower, math.nan)
    assert math.isnan(formation.look())
    assert formation.watch.max_used == 0.0
    assert formation.logged == []


def test_near_its_margin_a_vehicle_is_reported_once_and_once_when_it_is_clear_of_it() -> None:
    formation, shares = Formation(), (NEAR - 0.01, NEAR + 0.01, NEAR - 0.01, CLEAR + 0.01, CLEAR - 0.01, CLEAR + 0.01)
    counts = [(formation.use(share), len(formation.logged))[1] for share in shares]
    assert counts == [0, 1, 1, 1, 2, 2]
    assert formation.logged.of("delay_margin", 2) == [
        "uses 81% of its delay margin",
        "is well inside its delay margin again",
    ]


def test_beyond_its_margin_a_vehicle_is_marked_until_it_is_well_inside() -> None:
    formation = Formation()
    shares = (0.99, 1.01, NEAR + 0.01, NEAR - 0.01, 0.99)
    assert [(formation.use(share), formation.follower.identity in formation.watch.beyond)[1] for share in shares] == [
        *(False, True, True, False, False)
    ]


def test_gains_are_lowered_only_where_that_is_asked_for() -> None:
    formation = Formation(on_delay="warn")
    formation.use(1.5)
    assert np.all(np.array(formation.watch.bandwidth) == 1.0)
    assert formation.logged.of("gains") == []


@pytest.mark.parametrize(("on_delay", "held"), [("hold", True), ("warn", False), ("degrade", False)])
def test_those_beyond_their_margin_are_held_where_the_scenario_asks_for_that(on_delay: str, held: bool) -> None:
    watch, findings = Formation(on_delay=on_delay).watch, SimpleNamespace(beyond=set[VehicleId]())
    cycle: Any = SimpleNamespace(findings=findings)
    DelayMargins(watch, cycle)
    watch.beyond.add(VehicleId(1, 2))
    assert bool(findings.beyond) is held


@pytest.mark.parametrize(("clear", "lower"), [(0, True), (HOLD_LOOKS, False)])
def test_one_that_was_held_for_too_long_follows_with_lower_gains_and_times_between_count_less(
    clear: int, lower: bool
) -> None:
    formation = Formation(on_delay="hold")
    for share, looks in ((1.2, HOLD_LOOKS - 1), (NEAR / 2, clear), (1.2, 1)):
        for _ in range(looks):
            formation.use(share)
    said = [text for text in formation.logged.of("delay_margin", 2) if text.startswith("was held for")]
    assert len(said) == lower
    formation.use(1.2)
    assert (min(formation.watch.bandwidth[1]) < 1.0) == lower


def test_gains_come_down_until_the_margin_holds_and_return_after_ten_calm_looks() -> None:
    formation = Formation(on_delay="degrade")
    formation.use(DEGRADE - 0.01)
    assert np.all(np.array(formation.watch.bandwidth) == 1.0)
    assert formation.use(1.2) < DEGRADE
    lowered = formation.watch.bandwidth[1].copy()
    assert min(lowered) < 1.0
    assert formation.watch.bandwidth[0] == [1.0] * 3, "of that vehicle alone"
    (said,) = formation.logged.of("gains", 2)
    assert said.startswith("gains lowered; shares of the bandwidth: speed ")
    assert formation.use(1.2) < DEGRADE
    assert len(formation.logged.of("gains")) == 1, "nothing more to change"
    for _ in range(CALM_LOOKS - 1):
        assert formation.use(RESTORE / 4) < RESTORE
    assert formation.watch.bandwidth[1] == lowered
    formation.use(RESTORE / 4)
    assert np.all(np.array(formation.watch.bandwidth) == 1.0)
    assert formation.logged.of("gains")[1:] == ["gains are the scenario's again"]


def test_looks_that_are_not_calm_one_after_the_other_do_not_raise_gains() -> None:
    formation = Formation(on_delay="degrade")
    formation.use(1.2)
    lowered = formation.watch.bandwidth.copy()
    for _ in range(4):
        for _ in range(CALM_LOOKS - 1):
            formation.use(RESTORE / 4)
        formation.use(1.2)
    assert np.array_equal(formation.watch.bandwidth, lowered)
    assert len(formation.logged.of("gains")) == 1


def test_gains_that_can_not_come_down_any_further_are_not_reported_again_and_again() -> None:
    formation = Formation(on_delay="degrade")
    for _ in range(3):
        assert formation.use(50.0) > 1.0
    assert len(formation.logged.of("gains")) == 1


def test_one_that_leads_has_no_loop_any_more_and_its_gains_back() -> None:
    formation = Formation(on_delay="degrade")
    formation.use(1.2)
    formation.watch.beyond.add(formation.follower.identity)
    assert math.isnan(formation.look(formation.follower))
    assert formation.watch.bandwidth[1] == [1.0] * 3
    assert not formation.watch.beyond


def test_by_consensus_without_prediction_everyone_waits_for_the_latest_state_and_the_leader_has_a_loop_too() -> None:
    formation = Formation(3, type="consensus")
    alone = formation.look()
    assert formation.watch.used[0] > 0.0
    *_, third = formation.vehicles.values()
    formation.delay(third, 0.2)
    assert formation.look() > alone


def test_with_prediction_scatter_uses_the_margin_and_delay_does_not_and_wrong_lags_are_named_with_their_channel() -> (
    None
):
    formation = Formation(delay_compensation=True)
    formation.delay(formation.follower, 0.2)
    assert formation.look() == 0.0
    formation.delay(formation.follower, 0.2, sigma_s=0.02)
    assert [formation.look() for _ in range(LASTING_LOOKS)][-1] > 0.0
    formation.watch.check_loops(NOW, formation.leader, [[0.0, 0.0], [0.0, 3.0], [0.0, 0.0]])
    (said,) = formation.logged
    assert said.text.endswith(
        "of its delay margin: heading doesn't follow as its model says, time constants are 300% off"
    )
    assert said.details["lags_off"] == 3.0


class Slow:
    """Links with equal delays, at first unknown, and gains by design."""

    def __init__(self, *overrides: str) -> None:
        loaded = load_scenario(scenario(vehicles={"count": 3, "model": "arduplane"}), overrides)
        self.clocks = [SimpleNamespace(one_way_s=math.nan) for _ in loaded.vehicles]
        identified = {VehicleId(1, i): SimpleNamespace(clock=clock) for i, clock in enumerate(self.clocks, 1)}
        vehicles: dict[VehicleId, Any] = {**identified}
        self.given, self.logged = loaded.law, EventLog()
        self.watch = DesignWatch(loaded, vehicles, [self.retune], self.logged)
        self._retuned: Any = None

    def retune(self, scenario: Any) -> None:
        """Take new gains, as controller and margins do."""
        self._retuned = scenario

    def look(self, delay_s: float, *, begins: bool = False) -> Any:
        """Look once, with a link of this delay each way; return the law to fly from then on."""
        self.clocks[1].one_way_s, self._retuned = delay_s, None
        self.watch.check_loops(NOW, begins=begins)
        assert self._retuned in (None, self.watch.scenario)
        return self._retuned and self._retuned.law


def test_gains_by_design_are_for_the_delay_that_is_measured_before_any_is_commanded() -> None:
    slow, known = Slow(), Slow("law.design_delay_ms=300").given
    assert slow.look(0.298, begins=True) == known
    (said,) = slow.logged
    assert said.text == "links take 298 ms each way: gains are designed for 300 ms, instead of 0 ms"
    assert said.details["speed_kp"] == known.speed.kp < slow.given.speed.kp
    assert slow.look(0.34, begins=True) is None, "known well enough"


def test_gains_are_for_the_slowest_link_and_one_check_is_enough_before_the_first_setpoint() -> None:
    slow, findings = Slow(), SimpleNamespace(tuned=None)
    for clock, one_way_s in zip(slow.clocks, (0.02, 0.3, 0.12), strict=True):
        clock.one_way_s = one_way_s
    stage, cycle = FirstGainDesign(slow.watch), SimpleNamespace(begins=False, now=NOW, findings=findings)
    stage.run(cast("Any", cycle))
    assert slow.logged == []
    cycle.begins = True
    stage.run(cast("Any", cycle))
    assert findings.tuned is slow.watch.scenario
    assert findings.tuned.law.design_delay_ms == pytest.approx(300.0)


def test_in_flight_links_must_stay_slow_for_a_while_and_gains_do_not_become_faster_again() -> None:
    slow = Slow()
    looks = [0.3] * (SLOW_LOOKS - 1) + [0.02] + [0.3] * (SLOW_LOOKS - 1)
    assert [slow.look(each) for each in looks] == [None] * len(looks)
    law = slow.look(0.3)
    assert law.design_delay_ms == pytest.approx(300.0)
    assert [slow.look(0.0) for _ in range(2 * SLOW_LOOKS)] == [None] * 2 * SLOW_LOOKS


def test_what_a_scenario_gives_of_gains_by_design_stays_as_it_is_given() -> None:
    slow = Slow("law.speed.kp=0.123", "law.disturbance_observer_radps=0.2", "law.mixer.k_y=0.04")
    law = slow.look(0.3, begins=True)
    assert (law.speed.kp, law.disturbance_observer_radps, law.mixer.k_y) == (0.123, 0.2, 0.04)
    assert law.heading.kp < slow.given.heading.kp
    assert law.speed.ki < slow.given.speed.ki


@pytest.mark.parametrize("given", ["links.default.delay_ms=300", "law.design_delay_ms=260", "law.gains=clean"])
def test_delay_that_is_known_and_gains_that_are_not_by_design_change_nothing(given: str) -> None:
    assert Slow(given).look(0.3, begins=True) is None


class Link:
    """Probes every quarter of a second over a link whose delays change, and whose answers may overtake each other."""

    def __init__(self, delays_s: tuple[float, float], jitter_s: float, seed: int) -> None:
        """Use `delays_s` each way before and after a step during the eleventh second."""
        rng, self.sync, self.answers = np.random.default_rng(seed), ClockSync(), list[tuple[float, float, float]]()
        before_s, after_s = delays_s
        step_s = 10.0 + rng.uniform(0.0, 1.0)
        for sent_s in np.arange(0.0, 25.0, 0.25).tolist():
            up_s, down_s = rng.uniform(-jitter_s, jitter_s, 2)
            there_s = sent_s + up_s + (before_s if sent_s < step_s else after_s)
            back_s = there_s + down_s + (before_s if there_s < step_s else after_s)
            self.answers.append((back_s, sent_s, there_s))
        self.answers.sort()

    def receive(self, until_s: float) -> ClockSync:
        while self.answers and self.answers[0][0] <= until_s:
            back_s, sent_s, there_s = self.answers.pop(0)
            self.sync.observe(after(NOW, sent_s), round((5.0 + there_s) * NANOSECONDS), after(NOW, back_s))
        return self.sync


@pytest.mark.parametrize("delays_s", [(0.1, 0.5), (0.5, 0.1), (0.7, 0.1), (0.05, 0.2), (0.2, 0.05)])
@pytest.mark.parametrize("jitter_s", [0.0, 0.005, 0.02])
def test_a_step_of_the_delay_is_no_scatter(delays_s: tuple[float, float], jitter_s: float) -> None:
    """The prediction uses the new delay; half of the step as scatter would be 3 to 12 times the margin, for a look.

    Jitter with a uniform distribution makes a round trip scatter by 0.8 of it, and some looks see 1.6 times that.
    """
    max_s, known = 1.3 * jitter_s, Formation(delay_compensation=True)
    used: list[float] = []
    for one_way_s in delays_s:
        known.delay(known.follower, one_way_s, max_s)
        used.append(known.look())
    for seed in range(4 if jitter_s else 1):
        formation, link = Formation(delay_compensation=True, on_delay="hold"), Link(delays_s, jitter_s, seed)
        for second in range(6, 25):
            sync = link.receive(float(second))
            formation.delay(formation.follower, sync.one_way_s, sync.usual_jitter_s)
            formation.look()
        assert formation.watch.max_used <= max(used) + 1e-6


def test_jitter_that_lasts_is_reported_after_four_looks() -> None:
    assert LASTING_LOOKS == 4
    formation = Formation(delay_compensation=True)
    formation.look()
    used: list[float] = []
    for _ in range(4):
        formation.delay(formation.follower, 0.2, 0.1)
        used.append(formation.look())
    assert used[:3] == [0.0, 0.0, 0.0]
    assert used[3] > 0.5
