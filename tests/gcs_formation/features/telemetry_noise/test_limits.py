"""From which ratio on noise is reported and until when, which quantity is named, and which airspeeds are rejected."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from airlink.clock import Instant, after
from airlink.endpoint import VehicleId
from gcs_formation.features.telemetry_noise.feature import FEATURE
from tests.gcs_formation.event_log import EventLog

FIRST, SECOND = VehicleId(1, 7), VehicleId(1, 4)
AS_DECLARED = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
SIGMA = (0.31, 0.42, 0.053, 0.164, 0.275, 0.0086)


class Watched:
    """Two vehicles whose indices aren't in the order of their numbers, seen once a second from 100 s on."""

    def __init__(self) -> None:
        self.vehicles: dict[VehicleId, Any] = {
            identity: SimpleNamespace(
                identity=identity,
                index=index,
                sampler=SimpleNamespace(airspeed_check=SimpleNamespace(accepted=True, synthetic_mps=20.26)),
                telemetry=SimpleNamespace(airspeed_mps=33.14),
            )
            for identity, index in ((FIRST, 1), (SECOND, 0))
        }
        self.logged = EventLog()
        cycle: Any = SimpleNamespace(vehicles=self.vehicles, log_event=self.logged, now=after(Instant(0), 99.0))
        self.cycle = cycle
        (self.watch,) = FEATURE.stages(cycle)

    def see(self, first: tuple[float, ...] = AS_DECLARED, second: tuple[float, ...] = AS_DECLARED) -> list[Any]:
        """Let a second pass with the ratios to the noise declared; return the events of it."""
        before = len(self.logged)
        noise = [
            SimpleNamespace(ratios=lambda: second, sigma=lambda: (9.0,) * 6),
            SimpleNamespace(ratios=lambda: first, sigma=lambda: SIGMA),
        ]
        filters = [SimpleNamespace(noise=each) for each in noise]
        self.cycle.controller = SimpleNamespace(estimator=SimpleNamespace(filters=filters))
        self.cycle.now = after(self.cycle.now, 1.0)
        self.watch.run(self.cycle)
        return self.logged[before:]


def but(index: int, ratio: float) -> tuple[float, ...]:
    return (*AS_DECLARED[:index], ratio, *AS_DECLARED[index + 1 :])


@pytest.mark.parametrize("inverse", [False, True])
@pytest.mark.parametrize("index", range(6))
def test_noise_off_by_1_8_is_reported_once_and_its_end_below_1_4(index: int, inverse: bool) -> None:
    """Ratios as declared are 1; more noise and less count alike. Up to 1.8 and from 1.4 on nothing changes."""
    watched = Watched()
    texts = list[list[str]]()
    for times in (1.79, 1.81, 2.5, 1.41, 1.79, 1.39, 1.79, 1.0, 1.81):
        texts.append([each.text for each in watched.see(but(index, 1.0 / times if inverse else times))])
    words = (
        "position is {} times as noisy as declared: 0.31 m",
        "height is {} times as noisy as declared: 0.42 m",
        "velocity is {} times as noisy as declared: 0.053 m/s",
        "climb is {} times as noisy as declared: 0.16 m/s",
        "airspeed is {} times as noisy as declared: 0.28 m/s",
        "heading is {} times as noisy as declared: 0.0086 rad",
    )[index]
    begins, ends = [words.format("0.6" if inverse else "1.8")], ["is as noisy as declared again"]
    assert texts == [[], begins, [], [], [], ends, [], [], begins]


def test_a_ratio_of_1_8_is_off_and_one_of_1_4_is_not_yet_as_declared() -> None:
    watched = Watched()
    assert [len(watched.see(but(2, ratio))) for ratio in (1.8, 1.4, 1.0)] == [1, 0, 1]


def test_the_quantity_that_differs_most_is_named_with_its_ratio_and_time() -> None:
    """0.4 is off by 2.5, more than 2.2; at the end 0.8 is off by 1.25, more than 1.2."""
    watched = Watched()
    (begins,) = watched.see((1.9, 0.4, 2.2, 0.5, 1.0, 2.4))
    assert begins == (
        100.0,
        "noise",
        "height is 0.4 times as noisy as declared: 0.42 m",
        FIRST.system,
        {"ratio": 0.4},
    )
    (ends,) = watched.see((1.1, 1.0, 0.8, 0.9, 1.2, 1.0))
    assert ends == (101.0, "noise", "is as noisy as declared again", FIRST.system, {"ratio": 0.8})


def test_each_vehicle_has_a_noise_of_its_own() -> None:
    watched, off = Watched(), but(1, 3.0)
    assert [each.vehicle for each in watched.see(AS_DECLARED, off)] == [SECOND.system]
    assert [each.vehicle for each in watched.see(off, off)] == [FIRST.system]
    assert [each.vehicle for each in watched.see(off, AS_DECLARED)] == [SECOND.system]
    assert [each.vehicle for each in watched.see(off, off)] == [SECOND.system]
    assert [each.vehicle for each in watched.see()] == [FIRST.system, SECOND.system]


def test_an_airspeed_that_is_not_plausible_is_reported_once_with_what_it_should_be_and_when_it_is_again() -> None:
    watched = Watched()
    assert watched.see() == []
    check = watched.vehicles[SECOND].sampler.airspeed_check
    check.accepted = False
    (begins,) = watched.see()
    said = "the 33.1 m/s that it measures is rejected: velocity over ground and wind show 20.3 m/s"
    assert begins == (101.0, "airspeed", said, SECOND.system, {"begins": True})
    assert watched.see() == []
    watched.vehicles[FIRST].sampler.airspeed_check.accepted = False
    assert [(each.vehicle, each.details) for each in watched.see()] == [(FIRST.system, {"begins": True})]
    check.accepted = True
    (ends,) = watched.see()
    assert ends == (104.0, "airspeed", "what it measures is accepted again", SECOND.system, {"begins": False})
    check.accepted = False
    assert [each.details for each in watched.see()] == [{"begins": True}]


def test_one_that_measures_no_airspeed_is_passed_over_and_the_others_are_not() -> None:
    watched = Watched()
    watched.vehicles[FIRST].sampler.airspeed_check = None
    watched.vehicles[SECOND].sampler.airspeed_check.accepted = False
    assert [each.vehicle for each in watched.see()] == [SECOND.system]
