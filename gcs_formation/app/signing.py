"""The keys of a flight's links: read from their files, their timestamps kept, and links without a key named."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from airlink.clock import Clock, Instant, VirtualClock
from airlink.endpoint import Endpoint, parse_endpoint
from airlink.signing.authentication import Authentication
from airlink.signing.kept_timestamps import KeptTimestamps
from airlink.signing.key import ALLOWED, KeyFileError, SigningKey, read_key
from airlink.signing.signed_links import SignedLink, SignedLinks
from formation_scenario import Scenario
from formation_scenario.fields import refused
from formation_scenario.vehicles import Vehicle
from gcs_formation.from_scenario import sockets


class FlightSigning:
    """What signs a flight's frames and judges those that arrive."""

    def __init__(self, scenario: Scenario, utc_at_0_us: int, *, keeps: bool) -> None:
        """Read the keys; `keeps`: whether timestamps are kept over restarts, as under the real clock.

        Raises:
            ScenarioError: a key file, or the file beside it that keeps its timestamps, can't be used.
        """
        self._kept = list[tuple[KeptTimestamps, Authentication]]()
        self.states = dict[SigningKey, Authentication]()
        """What each key has signed and seen."""
        self.failure: str | None = None
        """Why timestamps can't be kept any more."""
        each = list(sockets(scenario).values())
        if any(scenario.signing_of(vehicle) for vehicle in scenario.vehicles):
            firsts = {vehicle.endpoints[0] for vehicle in scenario.vehicles}
            ids = (0 if text in firsts else 1 + index for index, text in enumerate(sockets(scenario)))
            links = [
                self._link(scenario, vehicles[0], link_id, utc_at_0_us, keeps=keeps)
                for vehicles, link_id in zip(each, ids, strict=True)
            ]
            self.links: SignedLinks | None = SignedLinks(links, _reserved(scenario, each))
        else:
            self.links = None

    def _link(
        self, scenario: Scenario, vehicle: Vehicle, link_id: int, utc_at_0_us: int, *, keeps: bool
    ) -> SignedLink | None:
        signing = scenario.signing_of(vehicle)
        if signing is None or signing.file is None:
            return None
        try:
            state = self._state(signing.file, utc_at_0_us, keeps=keeps)
        except KeyFileError as error:
            raise refused("links.default.signing.key_file", str(error), ALLOWED) from error
        return SignedLink(state, link_id=link_id, takes_unsigned=signing.unsigned == "accept")

    def _state(self, file: Path, utc_at_0_us: int, *, keeps: bool) -> Authentication:
        key = read_key(file)
        if key not in self.states:
            kept = KeptTimestamps(file)
            self.states[key] = kept.restored(key, utc_at_0_us) if keeps else Authentication(key, utc_at_0_us)
            if keeps:
                kept.keep(self.states[key])
                self._kept.append((kept, self.states[key]))
        return self.states[key]

    def keep(self, now: Instant | None = None) -> None:
        """Keep the timestamps if that is due, without `now` in any case."""
        for kept, state in self._kept:
            try:
                if now is None:
                    kept.keep(state)
                else:
                    kept.keep_in_time(state, now)
            except KeyFileError as error:
                self.failure = self.failure or str(error)


def flight_signing(scenario: Scenario, clock: Clock) -> FlightSigning:
    """Return what signs a flight's frames; under the virtual clock timestamps follow from it, and none is kept.

    Raises:
        ScenarioError: a key file can't be used.
    """
    return FlightSigning(scenario, clock.utc_at_0_us, keeps=not isinstance(clock, VirtualClock))


def _reserved(scenario: Scenario, each: list[list[Vehicle]]) -> list[frozenset[int]]:
    """Return for each socket the system ids of signed vehicles whose key another socket has."""
    signed = [vehicle for vehicle in scenario.vehicles if scenario.signing_of(vehicle) is not None]
    found = list[frozenset[int]]()
    for vehicles in each:
        here = vehicles[0]
        others = (one for one in signed if scenario.signing_of(one) != scenario.signing_of(here))
        found.append(frozenset(one.id for one in others if one.network == here.network))
    return found


def open_links(scenario: Scenario) -> Iterator[str]:
    """Yield in words each link without a key that others than this machine's programs can reach, and its vehicles."""
    for text, vehicles in sockets(scenario).items():
        endpoint = parse_endpoint(text)
        if is_loopback(endpoint):
            continue
        signing = scenario.signing_of(vehicles[0])
        whom = f"vehicle{'s' if len(vehicles) > 1 else ''} {', '.join(str(each.vehicle_id) for each in vehicles)}"
        if signing is None:
            yield f"{endpoint} isn't signed: any sender there can fly {whom} (links.default.signing)"
        elif signing.unsigned == "accept":
            yield f"{endpoint} takes unsigned frames: any sender there can speak for {whom}"


def is_loopback(endpoint: Endpoint) -> bool:
    """Return whether only programs on this machine reach a link."""
    if endpoint.kind in {"serial", "mcast"}:
        return False
    host = endpoint.address.host
    with suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return host == "localhost"
