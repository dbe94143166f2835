"""`gcs-formation signing`: gives a scenario's vehicles their links' keys, or takes them away, over real links."""

from __future__ import annotations

from collections.abc import Collection

from airlink.clock import NANOSECONDS, RealClock
from airlink.driver import Driver
from airlink.endpoint import Endpoint, PortError, parse_endpoint
from airlink.signing.key import SigningKey, read_key
from airlink.signing.setup import Asked, KeySetup
from airlink.transports.udp import resolved
from formation_scenario import Scenario, Vehicle
from formation_scenario.fields import refused
from gcs_formation.app.signing import FlightSigning, is_loopback
from gcs_formation.errors import RunAbortedError
from gcs_formation.from_scenario import sockets

LIMIT_S = 20.0
"""How long a vehicle has to be received and to sign: one that boots needs some seconds."""
NO_CABLE = "loopback, or with --cable a serial line that is a cable and no radio: the key is sent as it is"


def set_up_keys(scenario: Scenario, only: Collection[int], *, remove: bool, cable: bool) -> list[int]:
    """Give vehicles their link's key, or take it away; return their system ids.

    Args:
        scenario: says who they are, and which key each link has.
        only: system ids; all, if empty.
        remove: take it away.
        cable: whether serial lines are cables, on which no one listens.

    Raises:
        ScenarioError: a link without a key, or on which the key would be sent through the air or a network.
        RunAbortedError: a port is taken, or a vehicle isn't received or doesn't sign.
    """
    links = sockets(scenario)
    endpoints = tuple(parse_endpoint(text) for text in links)
    chosen = _chosen(scenario, list(links.values()), only)
    for socket in () if remove else sorted({each.socket for each in chosen}):
        _require_private(endpoints[socket], cable=cable)
    clock = RealClock()
    signing = FlightSigning(scenario, clock.utc_at_0_us, keeps=True)
    setup = KeySetup(
        tuple(resolved(each) for each in endpoints), chosen, scenario.station.ids, signing.states, remove=remove
    )
    try:
        with Driver(setup, clock) as driver:
            driver.run(lambda: setup.done or clock.now() > LIMIT_S * NANOSECONDS)
    except PortError as error:
        raise RunAbortedError(str(error)) from error
    finally:
        signing.keep()
    if not setup.done:
        raise RunAbortedError("\n".join(setup.failures()))
    return setup.finished()


def _chosen(scenario: Scenario, links: list[list[Vehicle]], only: Collection[int]) -> list[Asked]:
    found = list[Asked]()
    for socket, vehicles in enumerate(links):
        for each in vehicles:
            if not only or each.id in only:
                found.append(Asked(each.id, socket, _key(scenario, each)))
    return found


def _key(scenario: Scenario, vehicle: Vehicle) -> SigningKey:
    signing = scenario.signing_of(vehicle)
    if signing is None or signing.file is None:
        raise refused("links.default.signing", f"found none for vehicle {vehicle.vehicle_id}", "{key_file: FILE}")
    return read_key(signing.file)


def _require_private(endpoint: Endpoint, *, cable: bool) -> None:
    if not (is_loopback(endpoint) or (cable and endpoint.kind == "serial")):
        raise refused("vehicles.endpoint", f"found {endpoint}", NO_CABLE)
