"""What one vehicle is flown by, when it is unfit, and which changes are said and when; its messages are made up."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant, after
from airlink.messages.telemetry import Attitude
from flight_model.autopilot_model import AutopilotModel
from flight_model.flight_state import FlightState
from flight_model.slot import UNKNOWN, Vector3
from gcs_formation.estimation.sample import Sample
from gcs_formation.features.telemetry_health.consistency import POSITION, VELOCITY
from gcs_formation.features.telemetry_health.monitor import TelemetryHealth
from gcs_formation.features.telemetry_health.stages import Examined, RestartForgotten
from gcs_formation.features.telemetry_health.vehicle_health import Commanded, VehicleHealth
from gcs_formation.vehicle.member import Member
from gcs_formation.vehicle.reported_motion import ReportedMotion
from gcs_formation.vehicle.telemetry import Telemetry
from tests.gcs_formation.event_log import EventLog
from tests.gcs_formation.features.telemetry_health.test_late_positions import NOISE, ORIGIN

MODEL = AutopilotModel(0.8, 0.6, 0.5, 1.5, 0.0, 20.0, 4.0, 0.5, 3.0)
"""Heights are reached with time constants of 2 s in all, at 3 m/s at most."""
START = Instant(0)
STEP_S = 0.1


def vehicle(*, hovers: bool = False) -> Any:
    return SimpleNamespace(
        identity=SimpleNamespace(system=2),
        index=0,
        telemetry=Telemetry(ORIGIN, hovers=hovers),
        sampler=SimpleNamespace(airspeed_check=None),
        clock=SimpleNamespace(one_way_s=0.0),
        jitter=SimpleNamespace(jitter_s=0.0),
        member=Member.FLYING,
        unfit="",
    )


class Flight:
    """A vehicle that flies north-east at 5 m/s and climbs at 1 m/s, and what is flown by."""

    def __init__(self, *, hovers: bool = False) -> None:
        self.vehicle, self.at_s = vehicle(hovers=hovers), 5.0
        self.health = VehicleHealth(self.vehicle, MODEL)
        self.wind: tuple[float, float] | None = None
        self.acting: Vector3 = UNKNOWN

    def sample(
        self,
        off_m: Vector3 = (0.0, 0.0, 0.0),
        mps: Vector3 = (3.0, 4.0, 1.0),
        *,
        yaw_rad: float = 0.3,
        late_s: float = 0.0,
    ) -> Sample:
        """Return the next one, which the telemetry has as well."""
        self.at_s += STEP_S
        place = [way * self.at_s + off for way, off in zip((3.0, 4.0, 1.0), off_m, strict=True)]
        seen, stamp_s = self.vehicle.telemetry, self.at_s - late_s
        north_m, east_m, up_m = (each + more for each, more in zip(place, seen.displaced_m, strict=True))
        seen.motion = ReportedMotion(stamp_s, north_m, east_m, up_m, *mps, up_m)
        seen.attitude = Attitude(stamp_s, 0.0, 0.0, yaw_rad, 0.0, 0.0, 0.0)
        return Sample(after(START, stamp_s), north_m, east_m, up_m, *mps, 5.0, math.atan2(4.0, 3.0))

    def fly(self, samples: int, *, leads: bool = False, **changed: Any) -> Sample:
        for _ in range(samples):
            sample = self.sample(**changed)
            state = None if self.wind is None else FlightState(0, 0, 0, 0, 5.0, 0.0, *self.wind)
            known: Any = SimpleNamespace(noise=NOISE.noise, state=state)
            commanded = Commanded(math.nan, self.acting, stops=False)
            flown = self.health.examine(sample, known, commanded, after(START, self.at_s), leads=leads)
        return flown

    def said(self, after_s: float = 0.0) -> list[tuple[str, bool, str]]:
        return self.health.changes(after(START, self.at_s + after_s))


@pytest.mark.parametrize("hovers", [False, True])
def test_a_sample_that_can_be_true_is_flown_itself(hovers: bool) -> None:
    flight = Flight(hovers=hovers)
    flight.fly(50)
    sample = flight.sample()
    known: Any = SimpleNamespace(noise=NOISE.noise, state=None)
    flown = flight.health.examine(
        sample, known, Commanded(math.nan, UNKNOWN, stops=False), after(START, flight.at_s), leads=False
    )
    assert flown is sample
    assert (flight.said(), flight.health.unfit, flight.health.height_unknown) == ([], "", False)


@pytest.mark.parametrize("leads", [False, True])
def test_a_multirotors_heading_that_jumps_is_flown_as_before(leads: bool) -> None:
    """A leader of 5 m/s has the axis of its course; others fly their ground speed at it."""
    flight = Flight(hovers=True)
    flight.fly(40, leads=leads)
    flown = flight.fly(5, leads=leads, yaw_rad=2.0)
    assert flown.airspeed_mps == pytest.approx(5.0, abs=0.01)
    assert flown.heading_rad == pytest.approx(math.atan2(4.0, 3.0), abs=0.01)
    assert flight.said() == [("attitude", False, "its heading has jumped by 97°: taken to be as before")]


def test_a_fixed_wings_heading_and_airspeed_that_jump_are_said() -> None:
    flight = Flight()
    flight.fly(40)
    sample = flight.sample()
    sample.heading_rad, sample.airspeed_mps = sample.heading_rad + 1.0, 35.0
    known: Any = SimpleNamespace(noise=NOISE.noise, state=None)
    now = after(START, flight.at_s)
    flown = flight.health.examine(sample, known, Commanded(math.nan, UNKNOWN, stops=False), now, leads=False)
    assert (flown.airspeed_mps, flown.heading_rad) == pytest.approx((5.0, math.atan2(4.0, 3.0)))
    assert (flown.north_m, flown.east_m, flown.height_m) == (sample.north_m, sample.east_m, sample.height_m)
    assert flight.said() == [
        ("attitude", False, "its heading has jumped by 57°: taken to be as before"),
        ("airspeed", False, "its airspeed has jumped by 30.0 m/s: taken to be as before"),
    ]


@pytest.mark.parametrize("hovers", [False, True])
def test_a_velocity_that_is_not_filled_is_derived_from_the_position(hovers: bool) -> None:
    """Gains of 0.25 m and then 0.5 m, of which 0.95 are kept, pass the bound of 2 m at 2.06 m."""
    flight = Flight(hovers=hovers)
    flight.fly(40)
    flown = flight.fly(30, mps=(0.0, 0.0, 1.0))
    assert (flown.north_mps, flown.east_mps) == pytest.approx((3.0, 4.0), abs=0.2)
    ((quantity, healthy, words),) = flight.said()
    assert (quantity, healthy) == ("velocity", False)
    assert words.startswith("its position moved 2.1 m otherwise than its velocity says: velocity not believed, that")
    if hovers:
        assert flown.airspeed_mps == pytest.approx(5.0, abs=0.2)


def test_a_position_that_freezes_is_carried_on_and_its_vehicle_is_unfit() -> None:
    flight = Flight()
    flight.fly(40)
    at_s = flight.at_s
    for number in range(60):
        frozen = tuple(-way * STEP_S * (number + 1) for way in (3.0, 4.0))
        flown = flight.fly(1, off_m=(*frozen, 0.0))
    assert (flown.north_m, flown.east_m) == pytest.approx((3.0 * flight.at_s, 4.0 * flight.at_s), abs=0.6)
    assert at_s < flight.at_s
    assert flight.health.unfit == "its position doesn't move by its velocity"
    ((quantity, _, words),) = flight.said()
    assert quantity == "position"
    assert words.endswith("position not believed, carried on by its velocity")


@pytest.mark.parametrize(("jump_m", "unfit"), [(29.5, ""), (30.5, "its position has jumped by 30 m")])
def test_one_that_is_displaced_by_more_than_30_m_is_unfit(jump_m: float, unfit: str) -> None:
    flight = Flight()
    flight.fly(40)
    flight.fly(60, off_m=(0.0, jump_m, 0.0))
    assert flight.vehicle.telemetry.displaced_m == pytest.approx((0.0, -jump_m, 0.0), abs=1e-6)
    assert flight.health.unfit == unfit
    assert flight.said()[0][2] == f"its position has jumped by {jump_m:.1f} m: taken to be where it was"


@pytest.mark.parametrize(("stacked", "unfit"), [(False, ""), (True, "its height doesn't move by its velocity")])
def test_a_height_that_is_wrong_again_and_again_makes_one_unfit_where_slots_are_stacked(
    stacked: bool, unfit: str
) -> None:
    flight = Flight()
    up: Any = flight.health._up
    up.wrong, up.lasts, flight.health.stacked = POSITION, True, stacked
    assert flight.health.unfit == unfit
    assert flight.health.height_unknown
    up.lasts = False
    assert flight.health.unfit == ""
    up.wrong = VELOCITY
    assert not flight.health.height_unknown
    assert flight.said()[0][:2] == ("velocity", False)


def test_what_goes_on_is_said_again_in_other_words_after_three_seconds_and_that_it_is_over_likewise() -> None:
    flight = Flight()
    across = flight.health._across
    across.is_noisy, across.sigma_m = True, 6.0
    words = "its position scatters by {} m or more: smoothed"
    assert flight.said(0.0) == [("position", False, words.format(6))]
    assert flight.said(10.0) == [], "in the same words it isn't said again"
    across.sigma_m = 9.0
    assert flight.said(11.0) == [("position", False, words.format(9))]
    across.sigma_m = 12.0
    assert flight.said(14.0) == []
    assert flight.said(14.1) == [("position", False, words.format(12))]
    across.is_noisy = False
    assert flight.said(17.1) == []
    assert flight.said(17.2) == [("position", True, "position: believed again")]
    assert flight.said(30.0) == []


def test_a_heights_evidence_is_said_as_a_heights() -> None:
    flight = Flight()
    flight.fly(40)
    flight.fly(40, off_m=(0.0, 0.0, 12.0))
    assert flight.said() == [("height", False, "its height has jumped by 12.0 m: taken to be where it was")]
    assert flight.vehicle.telemetry.displaced_m == pytest.approx((0.0, 0.0, -12.0), abs=1e-6)


@pytest.mark.parametrize(
    ("below_m", "climb_mps"), [(2.0, 1.0), (-2.0, -1.0), (6.1, 3.0), (60.0, 3.0), (-60.0, -3.0), (0.0, 0.0)]
)
def test_a_commanded_height_witnesses_a_climb_with_the_loops_time_constants_within_the_limit(
    below_m: float, climb_mps: float
) -> None:
    health = Flight().health
    assert health._climb_mps(below_m) == pytest.approx(climb_mps)
    assert math.isnan(health._climb_mps(math.nan))


def test_the_velocity_by_air_is_airspeed_along_the_heading_and_the_wind_known_before() -> None:
    """20 m/s at 120 degrees are -10 m/s north and 17.32 m/s east."""
    health = Flight().health
    assert all(math.isnan(each) for each in health._by_air(20.0, 0.0, None))
    blown = FlightState(0.0, 0.0, 0.0, 0.0, 20.0, 0.0, 2.0, -3.0)
    by_air = [2.0 - 10.0, -3.0 + 10.0 * math.sqrt(3.0)]
    assert health._by_air(20.0, math.radians(120.0), blown) == pytest.approx(by_air)
    health._across.wrong = VELOCITY
    later = FlightState(0.0, 0.0, 0.0, 0.0, 20.0, 0.0, 9.0, 9.0)
    assert health._by_air(20.0, math.radians(120.0), later) == pytest.approx(by_air)


@pytest.mark.parametrize(
    ("reason", "unfit"),
    [
        ({"_estimator": {"lost": True}}, "its estimator has no absolute position"),
        ({"_timing": {"frozen": True}}, "the stamps of its positions stand still"),
        ({"_timing": {"late_s": 2.25}}, "its positions come 2.2 s late"),
    ],
)
def test_each_reason_to_leave_is_said_and_forgotten_with_a_restart(
    reason: dict[str, dict[str, Any]], unfit: str
) -> None:
    flight = Flight()
    for part, values in reason.items():
        for name, value in values.items():
            setattr(getattr(flight.health, part), name, value)
    assert flight.health.unfit == unfit
    (quantity, healthy, _) = flight.said()[0]
    assert quantity == ("stamps" if "frozen" in str(reason) else "position")
    assert not healthy
    flight.health.begin()
    assert flight.health.unfit == ""


def test_late_positions_are_those_older_than_the_link_its_jitter_and_a_second_explain() -> None:
    """0.3 s under way, five times 0.1 s of jitter and 1 s: 1.8 s, while attitudes come at once."""
    for late_s, is_late in ((1.75, False), (1.85, True)):
        flight = Flight()
        flight.vehicle.clock.one_way_s, flight.vehicle.jitter.jitter_s = 0.3, 0.1
        for _ in range(30):
            sample = flight.sample(late_s=late_s)
            flight.vehicle.telemetry.attitude = Attitude(flight.at_s, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0)
            known: Any = SimpleNamespace(noise=NOISE.noise, state=None)
            now = after(START, flight.at_s)
            flight.health.examine(sample, known, Commanded(math.nan, UNKNOWN, stops=False), now, leads=False)
        assert (flight.health.unfit != "") == is_late


class Station:
    """A monitor of one vehicle, with its events."""

    def __init__(self, *, hovers: bool = False) -> None:
        self.flight, self.logged = Flight(hovers=hovers), EventLog()
        self.asked = list[tuple[int, int]]()
        history: Any = SimpleNamespace(
            commanded=lambda stamp, index: self.asked.append((stamp, index)) or (5.0, 0.9, 0.0)
        )
        known: Any = [SimpleNamespace(noise=NOISE.noise, state=None)]
        ones: Any = {0: self.flight.vehicle}
        self.monitor = TelemetryHealth(ones, known, [MODEL], history, self.logged, 12.0)

    def examine(self, commanded_m: float = math.nan, **changed: Any) -> Sample | None:
        sample = self.flight.sample(**changed)
        return self.monitor.examine(0, sample, commanded_m, after(START, self.flight.at_s), leads=False)


def test_a_jump_is_an_event_with_its_quantity_and_one_that_restarts_is_known_no_more() -> None:
    station = Station()
    for number in range(80):
        station.examine(off_m=(0.0, 40.0 * (number >= 30), 0.0))
    (event,) = station.logged[:1]
    assert (event.kind, event.vehicle, event.details) == ("health", 2, {"quantity": "position", "healthy": False})
    assert station.flight.vehicle.unfit == "its position has jumped by 40 m"
    RestartForgotten(station.monitor).run(SimpleNamespace(restarted=[0]))  # type: ignore[arg-type]
    assert station.flight.vehicle.unfit == ""
    station.flight.vehicle.telemetry.displaced_m = (0.0, 0.0, 0.0)
    for _ in range(50):
        station.examine(off_m=(0.0, 40.0, 0.0))
    assert station.logged[-1].details == {"quantity": "position", "healthy": True}
    assert station.monitor.examine(0, None, math.nan, after(START, station.flight.at_s), leads=False) is None


@pytest.mark.parametrize(
    ("hovers", "height_m", "asks"), [(True, 9.0, True), (True, math.nan, False), (False, 9.0, False)]
)
def test_only_of_a_multirotor_that_is_commanded_the_acting_setpoint_is_a_witness(
    hovers: bool, height_m: float, asks: bool
) -> None:
    station = Station(hovers=hovers)
    station.examine(height_m)
    assert station.asked == ([(after(START, 5.1), 0)] if asks else [])


@pytest.mark.parametrize("stacked", [True, False])
def test_a_height_that_is_unknown_is_judged_by_the_slots_commanded_last(stacked: bool) -> None:
    station = Station()
    health = station.monitor._each[0]
    station.monitor.slots_m = [UNKNOWN, (3.0 if stacked else 30.0, 0.0, 20.0)]
    station.examine()
    assert not health.stacked
    health._up.wrong = POSITION
    station.examine()
    assert health.stacked == stacked


@pytest.mark.parametrize(("active", "height_m"), [(True, 70.0), (False, math.nan)])
@pytest.mark.parametrize("leader", [0, 1])
def test_each_sample_is_examined_by_the_setpoint_of_the_tick_before(active: bool, height_m: float, leader: int) -> None:
    asked = list[tuple[Any, ...]]()

    def examine(*given: Any, leads: bool) -> str:
        asked.append((*given, leads))
        return "examined"

    health: Any = SimpleNamespace(examine=examine, slots_m=())
    last = SimpleNamespace(slots_left=False, slots_m=[(1.0, 2.0, 3.0)], active=[active], setpoints=[(1.0, 2.0, 70.0)])
    controller = SimpleNamespace(plan=SimpleNamespace(leader=leader))
    cycle: Any = SimpleNamespace(
        controller=controller, last_tick=last, samples=["stated"], each=[vehicle()], now=after(START, 1.0)
    )
    Examined(health).run(cycle)
    assert cycle.samples == ["examined"]
    ((index, stated, by_m, now, leads),) = asked
    assert (index, stated, now, leads) == (0, "stated", after(START, 1.0), leader == 0)
    assert by_m == pytest.approx(height_m, nan_ok=True)
    assert health.slots_m == [(1.0, 2.0, 3.0)]
    last.slots_left, last.slots_m = True, []
    Examined(health).run(cycle)
    assert health.slots_m == [(1.0, 2.0, 3.0)], "slots that were left say nothing"
    cycle.last_tick = None
    Examined(health).run(cycle)
    assert math.isnan(asked[-1][2])
