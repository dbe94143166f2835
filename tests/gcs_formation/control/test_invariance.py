"""What no law may depend on: where north is, which side is left, a wind that carries all alike, what it did before."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from flight_model.vehicle_arrays import AutopilotModels, FlightStates, Setpoints
from formation_scenario.fields import Frame
from formation_scenario.slot_motion import SlotMotion
from gcs_formation.control.consensus import ConsensusLaw
from gcs_formation.control.follower import FollowerController
from gcs_formation.control.follower_loops import LawParameters
from gcs_formation.control.fuzzy_pid import FuzzyGainScheduler
from gcs_formation.control.law_interface import Law
from gcs_formation.control.laws import FormationLaw, VelocityController
from gcs_formation.control.setpoint import AS_DECIDED, Mixer
from tests.gcs_formation import tables
from tests.gcs_formation.control.law_ticks import DT_S, LEADER, Array, cycle_input, parameters
from tests.gcs_formation.tables import Decision, TableLaw

COUNT, TICKS = 3, 8
LIMITS = np.array(
    (
        (4.0, 3.0, 5.0),
        (1.5, 2.0, 1.2),
        (1.0, 0.8, 1.3),
        (3.0, 2.5, 3.5),
        (16.0, 15.0, 17.0),
        (28.0, 27.0, 29.0),
        (1.5, 1.2, 1.8),
        (0.25, 0.2, 0.3),
        (3.0, 2.5, 3.5),
    )
)
MODELS = AutopilotModels(*LIMITS)
MIXER = Mixer(k_v=0.3, k_x=0.8, k_psi=0.25, k_y=0.04, k_z=0.7)
GRAPH = np.array([[0.0, 1.0, 0.5], [1.0, 0.0, 0.8], [2.0, 0.3, 0.0]])
NORTH, EAST, HEIGHT, CLIMB, SPEED, HEADING, WIND_NORTH, WIND_EAST, UPDRAUGHT = range(9)


def gains(frame: Frame, share: float = 1.0) -> LawParameters:
    kp, ki, kd = np.array((2.0, 1.0, 1.5)), np.array((0.8, 0.5, 0.4)), np.array((1.5, 0.4, 1.1))
    made = parameters(share * kp, share * ki, share * kd, frame, FuzzyGainScheduler("symmetric"), (4.0 * share, 2.0))
    return replace(made, mixer=MIXER, gust_radps=2.0 * share, slew=(1.6 * share, 1.04))


def follower_law(frame: Frame) -> Law:
    return FormationLaw(gains(frame), tables.models(MODELS), FollowerController)


def velocity_law(frame: Frame) -> Law:
    return FormationLaw(gains(frame), tables.models(MODELS), VelocityController)


def consensus_law(frame: Frame) -> Law:
    return ConsensusLaw((0.1, 0.6, 0.3), GRAPH, [0, 1, 2], frame, tables.models(MODELS))


LAWS: list[tuple[Callable[[Frame], Law], Frame]] = [
    (follower_law, "leader_heading"),
    (follower_law, "follower_heading"),
    (velocity_law, "leader_heading"),
    (consensus_law, "leader_heading"),
    (consensus_law, "follower_heading"),
]


@dataclass(frozen=True)
class Tick:
    """A situation: (9, C) states, (3, C) setpoints, the leader's turn rate, and (3, C, 3) slots with their motion."""

    states: Array
    commanded: Array
    turn_rps: float
    slots: Array


def ticks(seed: int) -> list[Tick]:
    """Return vehicles off their moving slots behind a turning leader: far off at first, so that limits act."""
    random, made = np.random.default_rng(seed), list[Tick]()
    offset = random.uniform(-1.0, 1.0, (9, COUNT)) * np.array([[60.0, 60.0, 30.0, 1.0, 4.0, 1.0, 1.0, 1.0, 0.3]]).T
    for tick in range(TICKS):
        share = 0.6**tick
        near = share * offset + random.uniform(-0.05, 0.05, (9, COUNT))
        level = np.array((0.0, 0.0, 100.0, 0.0, 22.0, 0.4, 0.0, 0.0, 0.0))
        slots = random.uniform(-0.4, 0.4, (3, COUNT, 3))
        slots[0] += np.array([[0.0, 0.0, 0.0], [-30.0, 20.0, 4.0], [-50.0, -25.0, -6.0]])
        slots[:, LEADER] = 0.0
        states = level[:, None] + near
        states[:3] += np.array([slots[0, :, 0], slots[0, :, 1], slots[0, :, 2]])
        states[:3, LEADER] = (0.0, 0.0, 100.0)
        commanded = states[[SPEED, HEADING, HEIGHT]] + random.uniform(-0.1, 0.1, (3, COUNT))
        made.append(Tick(states, commanded, float(random.uniform(-0.1, 0.1)), slots))
    return made


def decisions(law: Law, of: list[Tick]) -> list[Decision]:
    """Return what is decided tick by tick; some setpoints were replaced, and some of the wind isn't known."""
    found, table = list[Decision](), TableLaw(law)
    for index, tick in enumerate(of):
        slots = SlotMotion(tick.slots[0], tick.slots[1], tick.slots[2])
        here = cycle_input(FlightStates(*tick.states), Setpoints(*tick.commanded), tick.turn_rps, slots)
        replaced = [AS_DECIDED, (index % 4 == 2, False, index % 5 == 3), (False, index % 4 == 3, False)]
        shares = [[1.0] * 3, [1.0, 0.8, 0.7], [0.9, 0.95, 1.0]]
        changed = tables.changed(here, replaced=replaced, wind_variance=[1e-4] * COUNT, bandwidth=shares)
        found.append(table.decide(changed, DT_S))
    return found


def same(found: list[Decision], expected: list[Decision], signs: tuple[float, float, float], moved: Array) -> None:
    """Assert that setpoints and errors are those of other decisions but for signs, and setpoints but for a shift."""
    for one, other in zip(found, expected, strict=True):
        setpoints = np.array(signs)[:, None] * other.setpoints.table + moved[:, None]
        difference = one.setpoints.table - setpoints
        difference[1] = np.remainder(difference[1] + np.pi, 2.0 * np.pi) - np.pi
        np.testing.assert_allclose(difference, 0.0, atol=1e-8)
        np.testing.assert_allclose(one.error_m, np.array((1.0, signs[1], signs[2])) * other.error_m, atol=1e-8)


@pytest.mark.parametrize(("make", "frame"), LAWS)
def test_the_world_may_be_turned_and_moved(make: Callable[[Frame], Law], frame: Frame) -> None:
    here, angle = ticks(1), 2.2
    cos, sin = np.cos(angle), np.sin(angle)

    def turned(tick: Tick) -> Tick:
        states, commanded = tick.states.copy(), tick.commanded.copy()
        for north, east in ((NORTH, EAST), (WIND_NORTH, WIND_EAST)):
            one, other = tick.states[north], tick.states[east]
            states[north], states[east] = cos * one - sin * other, sin * one + cos * other
        states[[NORTH, EAST, HEIGHT]] += np.array([[1234.0, -777.0, 50.0]]).T
        states[HEADING] += angle
        commanded += np.array([[0.0, angle, 50.0]]).T
        return replace(tick, states=states, commanded=commanded)

    found = decisions(make(frame), [turned(tick) for tick in here])
    same(found, decisions(make(frame), here), (1.0, 1.0, 1.0), np.array((0.0, angle, 50.0)))


@pytest.mark.parametrize(("make", "frame"), [*LAWS, (follower_law, "north"), (consensus_law, "north")])
def test_left_is_as_right(make: Callable[[Frame], Law], frame: Frame) -> None:
    here = ticks(1)

    def mirrored(tick: Tick) -> Tick:
        states, commanded = tick.states.copy(), tick.commanded.copy()
        states[[EAST, HEADING, WIND_EAST]] *= -1.0
        commanded[1] *= -1.0
        return Tick(states, commanded, -tick.turn_rps, tick.slots * np.array((1.0, -1.0, 1.0)))

    found = decisions(make(frame), [mirrored(tick) for tick in here])
    same(found, decisions(make(frame), here), (1.0, -1.0, 1.0), np.zeros(3))


@pytest.mark.parametrize(("make", "frame"), LAWS)
def test_up_is_as_down(make: Callable[[Frame], Law], frame: Frame) -> None:
    here = ticks(1)

    def mirrored(tick: Tick) -> Tick:
        states, commanded = tick.states.copy(), tick.commanded.copy()
        states[[HEIGHT, CLIMB, UPDRAUGHT]] *= -1.0
        commanded[2] *= -1.0
        return Tick(states, commanded, tick.turn_rps, tick.slots * np.array((1.0, 1.0, -1.0)))

    found = decisions(make(frame), [mirrored(tick) for tick in here])
    same(found, decisions(make(frame), here), (1.0, 1.0, -1.0), np.zeros(3))


@pytest.mark.parametrize(("make", "frame"), [*LAWS, (follower_law, "north"), (consensus_law, "north")])
def test_a_wind_that_carries_all_alike_is_no_matter_even_in_gusts(make: Callable[[Frame], Law], frame: Frame) -> None:
    """Only the difference of two vehicles' winds is a drift (errata item 16)."""
    here = ticks(1)
    gusts = np.random.default_rng(7).uniform(-5.0, 5.0, (TICKS, 2, 1))

    def blown(tick: Tick, wind_mps: Array) -> Tick:
        states = tick.states.copy()
        states[[WIND_NORTH, WIND_EAST]] += wind_mps
        return replace(tick, states=states)

    found = decisions(make(frame), [blown(tick, wind) for tick, wind in zip(here, gusts, strict=True)])
    same(found, decisions(make(frame), here), (1.0, 1.0, 1.0), np.zeros(3))


FOLLOWER_LAWS = [(follower_law, "leader_heading"), (follower_law, "follower_heading"), (velocity_law, "leader_heading")]


@pytest.mark.parametrize(("make", "frame"), FOLLOWER_LAWS)
def test_who_was_not_commanded_or_has_another_leader_begins_as_new(make: Callable[[Frame], Law], frame: Frame) -> None:
    here, used = ticks(1), make(frame)
    assert isinstance(used, FormationLaw)
    decisions(used, ticks(2))
    for controller in used._controllers:
        controller.reset()
        assert np.isnan((controller.setpoint, controller.error_m, controller.mixed)).all()
    found, expected = decisions(used, here), decisions(make(frame), here)
    same(found, expected, (1.0, 1.0, 1.0), np.zeros(3))
    np.testing.assert_allclose([each.gains for each in found], [each.gains for each in expected])


@pytest.mark.parametrize(("make", "frame"), FOLLOWER_LAWS)
def test_what_is_tuned_again_is_as_if_made_so(make: Callable[[Frame], Law], frame: Frame) -> None:
    """Mixer, gains, scales, filter of the gusts and growth limits; after a reset nothing else is left."""
    here, other, made = ticks(1), gains(frame, 0.5), make(frame)
    assert isinstance(made, FormationLaw)
    kind = type(made._controllers[0])
    decisions(made, ticks(2))
    for controller in made._controllers:
        controller.reset()
    made.retune(replace(other, mixer=Mixer(0.2, 0.5, 0.1, 0.02, 0.4)))
    new = FormationLaw(replace(other, mixer=Mixer(0.2, 0.5, 0.1, 0.02, 0.4)), tables.models(MODELS), kind)
    same(decisions(made, here), decisions(new, here), (1.0, 1.0, 1.0), np.zeros(3))


@pytest.mark.parametrize(("make", "frame"), FOLLOWER_LAWS)
def test_mixed_errors_and_their_rates_are_sums_by_the_mixers_coefficients(
    make: Callable[[Frame], Law], frame: Frame
) -> None:
    """Equation (13) is linear: what five coefficients give is the sum of what each gives, times its size."""
    here, zero, law = [replace(tick, turn_rps=0.05) for tick in ticks(1)[5:]], np.zeros(3), make(frame)
    assert isinstance(law, FormationLaw)
    kind, plain = type(law._controllers[0]), replace(parameters(zero, zero, zero, frame), slew=(1e3, 1e3))

    def found(coefficients: Array) -> Array:
        mixer = Mixer(*coefficients.tolist())
        flying = FormationLaw(replace(plain, mixer=mixer), tables.models(MODELS), kind)
        decisions(flying, here)
        each = flying._controllers[1:]
        rates = [[channel.rate for channel in (one._forward, one._right, one._height)] for one in each]
        return np.array([[one.mixed for one in each], rates])

    weights = np.array((0.3, 0.8, 0.25, 0.04, 0.7))
    together = found(weights)
    singly = [weight * found(unit) for weight, unit in zip(weights, np.eye(5), strict=True)]
    np.testing.assert_allclose(together, np.sum(singly, axis=0), atol=1e-12)
    assert np.abs(together).min() > 1e-5
