"""How a vehicle is examined: its parameters are read, set where that is asked for, and judged once."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from airlink.messages.command import ParamRequestRead, ParamValue
from formation_scenario import load_scenario
from gcs_formation.features.preflight.parameters import ParameterExamination
from gcs_formation.vehicle.checks import Check
from gcs_formation.vehicle.own_fence import OwnFence
from tests.flights.conftest import scenario

SCENARIO = load_scenario(scenario(vehicles={"count": 1}, formation={"shape": "arrow", "spacing_m": 30}))
SLOW = Check(
    ("FASTEST",),
    "25 or more",
    lambda value: value >= 25.0,
    lambda value: value < 20.0,
    bounds=lambda value: ("speed_max_mps", value),
    asks=25.0,
)
REAL32 = 9


class Examined:
    """A vehicle whose one parameter is checked, and its examination."""

    def __init__(self, *, sets: bool = False, says: bool = False, flies: bool = False, fence_m: float | None = None):
        self.now, self.recorded, self.remembered = Instant(0), list[Any](), list[Any]()
        fence = None if fence_m is None else OwnFence(-math.inf, fence_m, math.inf, ("LOW", "HIGH", "ROUND"))
        self.approach: Any = None
        self.speeds_mps: Any = None
        autopilot = SimpleNamespace(
            checks=lambda _model, _path: [SLOW],
            parameter=lambda message: message.param_value,
            own_fence=lambda _values: fence,
            take_approach=lambda values: setattr(self, "approach", dict(values)),
            set_parameter=lambda name, value, kind: ("set", name, value, kind),
            commanded_airspeed=lambda mps: mps,
            true_airspeed=lambda mps: mps,
            bound_speeds=lambda *speeds_mps: setattr(self, "speeds_mps", speeds_mps),
            heights_m=None,
        )
        self.vehicle: Any = SimpleNamespace(
            identity=VehicleId(1, 1),
            index=0,
            autopilot=autopilot,
            airborne=flies,
            connection=SimpleNamespace(talks=True),
            telemetry=SimpleNamespace(motion=None, home_m=(0.0, 0.0)),
        )
        self.planned = list[Any]()
        gate = SimpleNamespace(
            sets_parameters=sets,
            says_what_to_set=says,
            restoration=SimpleNamespace(remember=lambda *given: self.remembered.append(given)),
            record=lambda vehicle, findings, now: self.recorded.append((vehicle, findings, now)),
        )
        cycle: Any = SimpleNamespace(
            scenario=SCENARIO,
            phase_machine=SimpleNamespace(gate=gate),
            reconfiguration=SimpleNamespace(plan_with=self.planned.append),
            controller=SimpleNamespace(bound=lambda *_: None),
            vehicles={self.vehicle.identity: self.vehicle},
        )
        self.examination = ParameterExamination(cycle)

    def requests(self) -> list[Any]:
        """Return what is sent a second later."""
        self.now = after(self.now, 1.0)
        return list(self.examination.requests(self.vehicle, self.now))

    def tell(self, value: float) -> None:
        self.examination.receive_parameter(self.vehicle, ParamValue("FASTEST", value, REAL32, 1, 0), self.now)

    def read(self, value: float) -> list[Any]:
        """Let it tell its parameter when asked; return what is sent next."""
        (request,) = self.requests()
        assert isinstance(request, ParamRequestRead)
        assert not self.examination.complete
        self.tell(value)
        return self.requests()

    @property
    def found(self) -> list[tuple[str, bool]]:
        """What was recorded, which is done once."""
        ((vehicle, findings, now),) = self.recorded
        assert (vehicle, now) == (self.vehicle, self.now)
        return [(each.text, each.refuses) for each in findings]


@pytest.mark.parametrize("flies", [False, True])
@pytest.mark.parametrize(("value", "found"), [(26.0, False), (22.0, True), (18.0, True)])
def test_a_parameter_is_read_judged_once_and_refuses_on_the_ground_alone(
    value: float, found: bool, flies: bool
) -> None:
    examined = Examined(flies=flies)
    assert examined.read(value) == []
    said = (f"FASTEST: found {value:g}; allowed: 25 or more", value < 20.0 and not flies)
    assert examined.found == [said] * found
    assert examined.examination.complete
    assert examined.approach == {"FASTEST": value}
    assert examined.requests() == []
    assert len(examined.recorded) == 1


def test_limits_that_it_tells_bound_its_speeds_and_plan_the_formation_again() -> None:
    examined = Examined()
    examined.read(22.5)
    assert examined.speeds_mps == (SCENARIO.vehicles[0].model.speed_min_mps, 22.5)
    ((planned,),) = examined.planned
    assert planned.model.speed_max_mps == 22.5
    other = Examined()
    other.read(26.0)
    assert other.planned == []


def test_what_it_cannot_fly_is_an_objection() -> None:
    examined = Examined()
    examined.read(18.0)
    (said,) = examined.examination.objections()
    assert said.startswith("what vehicles tell (vehicle 1: FASTEST 18) isn't enough for ")


def test_its_fence_is_judged_once_it_tells_its_position() -> None:
    examined = Examined(fence_m=50.0)
    examined.read(26.0)
    assert not examined.examination.complete
    examined.vehicle.telemetry.motion = SimpleNamespace(north_m=0.0, east_m=0.0, height_m=0.0, above_home_m=0.0)
    examined.requests()
    assert examined.examination.complete
    assert [each[:25] for each in examined.examination.objections()] == ["vehicle 1: HIGH: found 50"]


def test_one_that_is_not_heard_is_asked_nothing() -> None:
    examined = Examined()
    examined.vehicle.connection.talks = False
    assert examined.requests() == []


@pytest.mark.parametrize("answer", [25.0, 22.0])
def test_on_consent_it_is_set_and_said_what_could_not_be(answer: float) -> None:
    """An answer with another value than was set refuses it, from the third on."""
    examined = Examined(sets=True)
    asks = [("set", "FASTEST", 25.0, REAL32)]
    assert examined.read(22.0) == asks
    examined.tell(answer)
    for _ in range(2 if answer != 25.0 else 0):
        assert examined.requests() == asks
        assert not examined.recorded
        examined.tell(answer)
    assert examined.requests() == []
    ((vehicle, changes, _),) = examined.remembered
    assert (vehicle, [each.words for each in changes]) == (examined.vehicle, ["FASTEST: from 22 to 25"])
    texts = [text for text, _ in examined.found]
    refused = ["FASTEST: found 22; allowed: 25 or more", "couldn't set FASTEST: from 22 to 25"]
    assert texts == ([] if answer == 25.0 else refused)


@pytest.mark.parametrize(
    ("value", "given"), [(26.0, {"sets": True}), (22.0, {"sets": True, "flies": True}), (22.0, {})]
)
def test_nothing_is_set_of_what_is_allowed_in_flight_or_without_consent(value: float, given: dict[str, bool]) -> None:
    examined = Examined(**given)
    assert examined.read(value) == []
    assert len(examined.recorded) == 1
    assert [each for _, changes, _ in examined.remembered for each in changes] == []


@pytest.mark.parametrize("flies", [False, True])
def test_a_dry_run_says_what_would_be_set_on_the_ground(flies: bool) -> None:
    examined = Examined(says=True, flies=flies)
    examined.read(22.0)
    assert [text for text, _ in examined.found][1:] == ["would set FASTEST: from 22 to 25"] * (not flies)
