"""What a scenario's keys make of a law: its gains by channel, its kind of follower, its graph."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from formation_scenario import Scenario
from formation_scenario import law as keys
from formation_scenario.extensions import Origin, Registered
from formation_scenario.registry import Registry
from gcs_formation.control.consensus import ConsensusLaw
from gcs_formation.control.follower import FollowerController
from gcs_formation.control.follower_loops import Controller
from gcs_formation.control.fuzzy_pid import FIXED_GAINS, FuzzyGainScheduler, PidGains
from gcs_formation.control.law_over_all import LawOverAll
from gcs_formation.control.laws import (
    LAWS,
    FormationLaw,
    VelocityController,
    formation_law,
    gain_range,
    law_kind,
    law_parameters,
    nominal_gains,
)
from gcs_formation.control.setpoint import Mixer
from tests.gcs_formation import tables
from tests.gcs_formation.control import law_ticks
from tests.gcs_formation.control.scenarios import usual, with_law, with_vehicles

OTHER = ((0.0, 0.25, 0.5, 0.75, 1.0),) * 5


def channel(number: float) -> keys.PidGains:
    """Return gains and scales that no other channel has."""
    kp, ki, kd, error_scale, rate_scale = (number + place / 10.0 for place in range(5))
    return keys.PidGains(kp=kp, ki=ki, kd=kd, error_scale=error_scale, rate_scale=rate_scale)


def flown(kind: str, *, copters: bool = False, filter_s: float = 0.4) -> Scenario:
    """Return a scenario whose law has a number of its own for each key; its vehicles may hover."""
    base = usual()
    if copters:
        model = base.vehicles[0].model.model_copy(update={"hovers": True})
        base = with_vehicles({"role": "leader", "model": model}, {"id": 2, "model": model})
    return with_law(
        base,
        type=kind,
        mixer=keys.Mixer(k_v=0.1, k_x=0.2, k_psi=0.3, k_y=0.04, k_z=0.5),
        speed=channel(1.0),
        heading=channel(2.0),
        height=channel(3.0),
        anti_windup_s=7.0,
        derivative_filter_s=filter_s,
        disturbance_observer_radps=0.9,
        fuzzy=keys.Fuzzy(base=0.8, span=0.4, tables="symmetric", table_d=OTHER),
    )


@pytest.mark.parametrize("kind", ["pid", "fuzzy_pid"])
def test_each_channel_has_its_own_gains_and_scales_and_all_the_same_filter_and_windup(kind: str) -> None:
    made = law_parameters(flown(kind))
    for number, found in zip((1.0, 2.0, 3.0), (made.speed, made.heading, made.height), strict=True):
        assert found.nominal == PidGains(number, number + 0.1, number + 0.2, 0.4)
        assert (found.error_scale, found.rate_scale) == pytest.approx((number + 0.3, number + 0.4))
        assert found.anti_windup_s == 7.0
    assert (made.gust_radps, made.frame, made.mixer) == (0.9, "leader_heading", Mixer(0.1, 0.2, 0.3, 0.04, 0.5))


def test_gains_are_scheduled_by_the_scenarios_tables_and_range() -> None:
    scheduler = law_parameters(flown("fuzzy_pid")).scheduler
    assert scheduler is not None
    assert (scheduler.gain_range.base, scheduler.gain_range.span) == (0.8, 0.4)
    own = FuzzyGainScheduler("symmetric", (None, None, OTHER))
    assert scheduler.factors(0.3, -0.7) == own.factors(0.3, -0.7)
    assert own.factors(0.3, -0.7)[2] == pytest.approx(0.5), "0.25, 0.5, ... made symmetric is 0.5 everywhere"
    assert law_parameters(flown("pid")).scheduler is None
    assert gain_range(flown("pid")) == FIXED_GAINS


def test_a_derivative_without_a_filter_has_one_that_is_too_short_to_notice() -> None:
    bare = flown("pid", filter_s=0.0)
    assert nominal_gains(bare)[0].filter_s == 0.0
    assert law_parameters(bare).speed.nominal.filter_s == 1e-6
    assert law_parameters(flown("pid")).speed.nominal.filter_s == 0.4


def test_of_those_that_hover_both_horizontal_channels_have_the_gains_of_speed() -> None:
    hovering = flown("pid", copters=True)
    assert hovering.hovers
    assert [each.kp for each in nominal_gains(hovering)] == [1.0, 1.0, 3.0]
    made = law_parameters(hovering)
    assert made.heading == made.speed
    assert made.heading.error_scale == 1.3


@pytest.mark.parametrize(("copters", "kind"), [(False, FollowerController), (True, VelocityController)])
def test_followers_that_hover_have_the_law_of_velocities(copters: bool, kind: type[Controller]) -> None:
    law = formation_law(flown("pid", copters=copters), tables.models(law_ticks.MODEL))
    assert [type(each) for each in law._controllers] == [kind] * 3
    assert all(each.feedback is None for each in law._controllers)


class Own:
    """A law from outside."""

    def __init__(self, keys: Any) -> None:
        self.replaced: Any = None

    def reset(self) -> None:
        self.replaced = None

    def feedback(self, mixed: Any, slopes: Any, dt_s: float) -> tuple[float, float, float]:
        return 0.5, 0.0, 0.0


def named(kind: str) -> Scenario:
    """Return a scenario whose law is another's, of a kind."""
    registry = Registry([Registered(kind, "own", Own, 1, Origin("own.py", ""))])
    return with_law(flown("pid").with_registered(registry), type="own", parameters={})


def test_a_followers_law_from_outside_is_made_for_each_and_is_no_schedule() -> None:
    law = formation_law(named("law"), tables.models(law_ticks.MODEL))
    feedbacks = [each.feedback for each in law._controllers]
    assert len({id(each) for each in feedbacks}) == 3
    assert [each._index for each in feedbacks if each is not None] == [0, 1, 2]
    kind = law_kind(named("law"))
    assert (kind.name, kind.mutual, kind.has_margins, kind.scheduled) == ("own", False, False, False)
    assert kind.variants == (("", ()),)
    assert law_parameters(named("law")).scheduler is None


@pytest.mark.parametrize(
    ("kind", "made"),
    [("law", FormationLaw), ("formation law", LawOverAll), ("pid", FormationLaw), ("consensus", ConsensusLaw)],
)
def test_a_law_is_made_by_its_kind(kind: str, made: type[Any]) -> None:
    chosen = flown(kind) if kind in LAWS else named(kind)
    assert type(law_kind(chosen).make(chosen, tables.models(law_ticks.MODEL))) is made


def test_our_laws_are_what_the_documents_say() -> None:
    """Only consensus is mutual, only the fuzzy law is scheduled; the stability of all three is known."""
    assert [(kind.mutual, kind.scheduled, kind.has_margins) for kind in LAWS.values()] == [
        (False, False, True),
        (False, True, True),
        (True, False, True),
    ]


@pytest.mark.parametrize(("virtual", "members"), [(False, [0, 1, 2]), (True, [1, 2, 3])])
def test_the_graph_is_that_of_the_scenarios_vehicles_with_the_leader_at_index_0(
    virtual: bool, members: list[int]
) -> None:
    """Weights are by the order of the vehicles, in which the leader may be the last, or none of them."""
    graph = (0.0, 1.0, 2.0), (3.0, 0.0, 4.0), (5.0, 6.0, 0.0)
    base = with_vehicles({"id": 5}, {"id": 6}, {"id": 7, "role": "follower" if virtual else "leader"})
    consensus = keys.Consensus(k1=0.1, k2=0.6, k3=0.3, graph=graph)
    chosen = with_law(base, type="consensus", consensus=consensus)
    models = tables.models(law_ticks.MODEL)
    found = cast("ConsensusLaw", law_kind(chosen).make(chosen, [*models, models[0]] if virtual else models))
    order = [1, 2, 3] if virtual else [1, 2, 0]
    expected = np.zeros((4, 4) if virtual else (3, 3))
    for p, row in enumerate(graph):
        for q, weight in enumerate(row):
            expected[order[p], order[q]] = weight
    assert found._weights.tolist() == expected.tolist()
    assert found._members == members
    assert (found._k1, found._k2, found._k3) == (0.1, 0.6, 0.3)
