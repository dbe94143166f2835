"""A flight on the virtual clock with the user's simulators, whose clocks it steps."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

from airlink.cli import rare_garbage_collection
from airlink.clock import Instant, VirtualClock
from airlink.endpoint import LOOPBACK, Address, Endpoint, PortError, VehicleId
from airlink.engine import MemoryNetwork
from formation_scenario import Scenario
from formation_scenario.extensions import ExtensionError
from formation_scenario.fields import refused
from formation_scenario.scripted import ScriptedOrder
from formation_scenario.simulated import Place
from gcs_formation.app.operator_at_terminal import Interrupts
from gcs_formation.app.progress import Progress
from gcs_formation.app.run import Run, closed_if_it_raises, conclude, require_no_program
from gcs_formation.app.run_options import RunOptions
from gcs_formation.app.session import Session
from gcs_formation.app.sitl.exchange import ExchangeError
from gcs_formation.app.sitl.fleet import Simulated, simulated
from gcs_formation.app.sitl.flight import say_started
from gcs_formation.app.sitl.processes import Running, ended, running, with_free_ports
from gcs_formation.app.sitl.simulator import Home, SimulatorError
from gcs_formation.app.sitl.stepped.fleet import SteppedFleet
from gcs_formation.record.run_directory import TRUTH
from gcs_formation.record.summary import Summary
from sim_vehicles.config import FleetConfig, fleet_config
from sim_vehicles.truth import TruthWriter


def run_stepped(
    programs: Mapping[str, Path],
    scenario: Scenario,
    options: RunOptions,
    progress: Progress,
    interrupts: Interrupts,
) -> Summary:
    """Fly a scenario with simulators of the user's, which this starts, steps and ends; `programs`: by family.

    Raises:
        ScenarioError: a vehicle can't be simulated by these programs.
        RunAbortedError: a vehicle refused, a simulator ended.
        RecordError: the run directory can't be written.
    """
    require_no_program(scenario)
    with rare_garbage_collection():
        with in_step(programs, scenario, options, progress, interrupts) as (session, run_until):
            run_until(session.attend)
        return conclude(session)


@contextmanager
def in_step(
    programs: Mapping[str, Path],
    scenario: Scenario,
    options: RunOptions,
    progress: Progress,
    interrupts: Interrupts,
) -> Generator[tuple[Session, Run]]:
    """Yield a flight on the virtual clock with the user's simulators.

    Raises:
        ScenarioError: a vehicle can't be simulated by these programs.
        RunAbortedError: a port is taken, a simulator can't be started.
        RecordError: the run directory can't be written.
    """
    simulators, clock = simulated(programs, scenario, 1.0, stepped=True), VirtualClock()
    for index, act in scenario.scripted:
        if act.fault is not None:
            raise refused(f"orders.{index}.fault", f"found {act.fault.kind} with --sitl", "faults of emulated vehicles")
    session = Session(scenario, options, clock, progress, interrupts, emulated=False)
    session.ends_vehicles = True
    network = MemoryNetwork(clock)
    with ExitStack() as stack:
        try:
            fleet, processes = stack.enter_context(_stepped(session, with_free_ports(simulators)))
            say_started(session, simulators, programs)
            network.attach(fleet)
            network.attach(session.engine)
        except (PortError, SimulatorError, ExchangeError, ExtensionError) as error:
            raise session.could_not_begin(error) from error
        if scenario.registered:
            session.emulators_failure = lambda: fleet.environment.failures.first
            session.link_processes.positions = partial(_true_position, fleet, fleet.config)
        session.replace = partial(network.replace, session.engine)
        session.script.emulators, session.script.refuses_faults = partial(_disturb, fleet), True
        session.begin_to_wait()
        with closed_if_it_raises(session):
            yield session, partial(_run, network, session, fleet, processes)


def _run(
    network: MemoryNetwork,
    session: Session,
    fleet: SteppedFleet,
    processes: Sequence[Running],
    until: Callable[[], bool],
) -> None:
    """Run until a function holds; a flight fails if one of its simulators has ended."""

    def over() -> bool:
        now, station = session.clock.now(), session.station
        fleet.environment.receive_mission_time(station.flight.mission_time_s(now), now)
        if fleet.failure is not None and station.phase_machine.failure is None:
            station.phase_machine.fail(ended(processes) or fleet.failure, now)
        return until()

    network.run(over)


@contextmanager
def _stepped(session: Session, simulators: Sequence[Simulated]) -> Generator[tuple[SteppedFleet, list[Running]]]:
    """Run the simulators, each with the ports of its exchange and of its serial port."""
    scenario = session.scenario
    with ExitStack() as stack:
        truth = stack.enter_context(TruthWriter(session.recorder.path / TRUTH, len(scenario.vehicles)))
        exchanges = [
            stack.enter_context(closing(each.simulator.exchange(each.craft, scenario.seed))) for each in simulators
        ]
        waiting = [each.simulator.serial_port(each.craft) for each in simulators]
        config = on_their_ground(fleet_config(scenario), [each.craft.home for each in simulators])
        fleet = stack.enter_context(closing(SteppedFleet(config, exchanges, waiting, truth)))
        ported = [
            replace(each, craft=replace(each.craft, station=_listening(one.port), steps_port=one.exchange.port))
            for each, one in zip(simulators, fleet.each, strict=True)
        ]
        processes = stack.enter_context(running(ported, session.options.out))
        for exchange, process in zip(exchanges, processes, strict=True):
            exchange.has_ended = partial(_has_ended, process, session.interrupts)
        try:
            fleet.begin()
            _prepare(fleet, simulators)
        except ExchangeError as error:
            raise ExchangeError(ended(processes) or str(error)) from error
        yield fleet, processes


def on_their_ground(config: FleetConfig, homes: Sequence[Home]) -> FleetConfig:
    """Return a fleet whose vehicles stand at their homes' heights, which over terrain are those of the ground."""
    heights_m = [home.alt_m - config.origin.alt_m for home in homes]
    vehicles = (
        replace(each, start=replace(each.start, height_m=height_m))
        for each, height_m in zip(config.vehicles, heights_m, strict=True)
    )
    return replace(config, vehicles=tuple(vehicles))


def _prepare(fleet: SteppedFleet, simulators: Sequence[Simulated]) -> None:
    """Give simulators their missions, while their clocks go on, as they answer only then."""
    given = [(each, fleet.each[index]) for index, each in enumerate(simulators) if each.craft.landing]
    if not given:
        return
    threads = ThreadPoolExecutor(len(given))
    try:
        prepared = [threads.submit(each.simulator.prepare, each.craft, one.clock_s) for each, one in given]
        while not all(each.done() for each in prepared):
            fleet.run_on()
            fleet.drop_sent()
    finally:
        threads.shutdown(wait=False, cancel_futures=True)
    for each in prepared:
        each.result()


def _has_ended(process: Running, interrupts: Interrupts) -> bool:
    """Return whether a simulator needn't be waited for: it has ended, or the operator insists."""
    return bool(process.ended) or interrupts.count > 1


def _listening(port: int) -> Endpoint:
    return Endpoint("udpin", Address(LOOPBACK, port))


def _disturb(fleet: SteppedFleet, act: ScriptedOrder, hit: frozenset[VehicleId], zero: Instant) -> None:
    """Let a program disturb the air."""
    if act.disturbance is not None:
        fleet.environment.disturb(act.disturbance, hit, zero)


def _true_position(fleet: SteppedFleet, config: FleetConfig, vehicle: VehicleId) -> Place:
    index = next(index for index, each in enumerate(config.vehicles) if each.identity == vehicle)
    state = fleet.bodies[index].state
    return Place(state.north_m, state.east_m, state.height_m)
