"""SETUP_SIGNING as an ArduPilot takes it, by pymavlink, which then signs too."""

import pytest

from airlink.clock import VIRTUAL_EPOCH_US, VirtualClock
from airlink.endpoint import ComponentId, VehicleId, parse_endpoint
from airlink.engine import MemoryNetwork
from airlink.signing.authentication import A_MINUTE, EPOCH_US, Authentication, Verdict
from airlink.signing.key import key_of_passphrase
from airlink.signing.setup import Asked, KeySetup
from airlink.signing.signature import is_authentic, is_signed, timestamp_of, unsigned
from formation_scenario.origin import Origin
from formation_scenario.start_states import StartState
from sim_vehicles.config import FleetConfig, VehicleConfig
from sim_vehicles.fleet import Fleet
from tests.sim_vehicles.conftest import Air
from tests.sim_vehicles.test_px4 import COPTER

KEY = key_of_passphrase("swarm")
NOW = (VIRTUAL_EPOCH_US - EPOCH_US) // 10
ARM = 400


@pytest.fixture
def air():
    """Return a vehicle that is up and ready, and a ground station received by it."""
    config = VehicleConfig(VehicleId(1, 1), parse_endpoint("udpout:127.0.0.1:14550"), StartState(0.0, 0.0))
    found = Air(FleetConfig(Origin().geodetic, (config,), ready_s=0.0))
    found.ground.send(found.ground.dialect.heartbeat_encode(6, 8, 0, 0, 4))
    found.run(2.0)
    return found


def set_up(air, key=KEY.octets, timestamp=NOW):
    air.ground.send(air.ground.dialect.setup_signing_encode(1, 1, list(key), timestamp))
    air.run(1.2)


def signs(peer, stamp, key=KEY.octets):
    """Have pymavlink sign at a peer, and refuse what isn't signed."""
    signing = peer.dialect.signing
    signing.secret_key, signing.timestamp, signing.sign_outgoing = key, stamp, key is not None
    peer.parser.signing.secret_key, peer.parser.signing.timestamp = key, stamp


def by_clock(air):
    return NOW + round(1e5 * air.seconds)


def newest(air):
    return air.sent[-1][1].data


def arms(air):
    """Return whether a command to arm is carried out."""
    air.ground.send(air.ground.dialect.command_long_encode(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0))
    air.run(0.5)
    return air.fleet.vehicles[0].pilot.condition.armed


def test_with_a_key_it_signs_begins_a_minute_later_and_pymavlink_takes_it(air):
    assert not is_signed(newest(air))
    set_up(air)
    assert is_authentic(newest(air), KEY.octets)
    assert NOW + A_MINUTE < timestamp_of(newest(air)) < NOW + A_MINUTE + 10**6
    received = len(air.ground.received)
    signs(air.ground, NOW)
    air.run(1.0)
    assert air.ground.parser.signing.goodsig_count == len(air.ground.received) - received > 0


def test_it_refuses_what_isnt_signed_with_its_key_and_takes_what_is(air):
    set_up(air)
    assert not arms(air)
    signs(air.ground, NOW + A_MINUTE, key_of_passphrase("another").octets)
    assert not arms(air)
    signs(air.ground, by_clock(air))
    assert arms(air)
    refused = air.fleet.vehicles[0].link.signed.judged[255].refused
    assert refused == {Verdict.UNSIGNED: 1, Verdict.WRONG_KEY: 1}


def test_an_armed_one_is_set_up_with_no_key_and_says_so(air):
    assert arms(air)
    set_up(air)
    assert not is_signed(newest(air))
    assert [each.text for each in air.ground.of("STATUSTEXT")][-1] == "ERROR: Won't setup signing when armed"


def test_a_signed_key_of_zeros_ends_it_and_an_unsigned_one_does_not(air):
    set_up(air)
    set_up(air, bytes(32), 0)
    assert is_signed(newest(air))
    signs(air.ground, NOW + A_MINUTE)
    set_up(air, bytes(32), 0)
    assert not is_signed(newest(air))
    signs(air.ground, 0, None)
    assert arms(air)


def test_its_key_is_kept_over_a_restart_and_older_frames_stay_old(air):
    set_up(air)
    signs(air.ground, NOW + A_MINUTE)
    recorded = air.ground.dialect.command_long_encode(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0).pack(air.ground.dialect)
    air.run(0.5)
    before = timestamp_of(newest(air))
    air.ground.send(air.ground.dialect.command_long_encode(1, 1, 246, 0, 1, 0, 0, 0, 0, 0, 0))
    air.run(0.1)
    air.ground.send_bytes(recorded)
    air.run(3.0)
    assert not air.fleet.vehicles[0].pilot.condition.armed
    air.ground.send(air.ground.dialect.heartbeat_encode(6, 8, 0, 0, 4))
    air.run(2.0)
    assert is_authentic(newest(air), KEY.octets)
    assert timestamp_of(newest(air)) >= before + A_MINUTE


def test_time_that_is_reported_at_once_is_sent_to_holders_of_the_key_alone():
    """A PX4 answers TIMESYNC as it comes, before its loop reads anything."""
    end = parse_endpoint("udpout:127.0.0.1:14550")
    config = VehicleConfig(VehicleId(1, 1), end, StartState(0.0, 0.0), COPTER, "px4_copter", signing_key=KEY)
    air = Air(FleetConfig(Origin().geodetic, (config,), ready_s=0.0))
    signs(air.ground, NOW)
    air.ground.send(air.ground.dialect.heartbeat_encode(6, 8, 0, 0, 4))
    air.run(2.0)
    signed_request = bytes(air.ground.dialect.timesync_encode(0, 7).pack(air.ground.dialect))

    def answered(raw):
        air.fleet.datagrams_to_send()
        air.ground.send_bytes(raw)
        return len(air.fleet.datagrams_to_send())

    assert [answered(unsigned(signed_request)), answered(signed_request), answered(signed_request)] == [0, 1, 0]
    air.run(0.1)
    link = air.fleet.vehicles[0].link.signed
    assert link is not None
    assert link.judged[255].refused == {Verdict.UNSIGNED: 1, Verdict.REPLAYED: 1}


# Our own command, `gcs-formation signing setup` and `remove`, in memory.


def setup(fleet, network, remove=False, key=KEY):
    states = {key: Authentication(key, VIRTUAL_EPOCH_US)}
    here = parse_endpoint("udpin:127.0.0.1:14550")
    found = KeySetup([here], [Asked(1, 0, key)], ComponentId(255, 25), states, remove=remove)
    network.attach(found)
    until = network.clock.now() + 10 * 10**9
    network.run(lambda: found.done or network.clock.now() > until)
    return found


@pytest.mark.parametrize("arms_first", [False, True])
def test_our_command_gives_the_key_to_a_vehicle_that_is_disarmed(arms_first):
    config = VehicleConfig(VehicleId(1, 1), parse_endpoint("udpout:127.0.0.1:14550"), StartState(0.0, 0.0))
    fleet, network = Fleet(FleetConfig(Origin().geodetic, (config,), ready_s=0.0)), MemoryNetwork(VirtualClock())
    network.attach(fleet)
    if arms_first:
        network.run(lambda: network.clock.now() > 2 * 10**9)
        fleet.vehicles[0].arm(force=True)
    found = setup(fleet, network)
    assert found.done is not arms_first
    if arms_first:
        words = "vehicle 1 doesn't sign; it said \"ERROR: Won't setup signing when armed\""
        assert found.failures() == [words]
    else:
        assert fleet.vehicles[0].link.signed is not None


def test_our_command_takes_the_key_away_and_names_who_has_another():
    for key in (KEY, key_of_passphrase("another")):
        end = parse_endpoint("udpout:127.0.0.1:14550")
        config = VehicleConfig(VehicleId(1, 1), end, StartState(0.0, 0.0), signing_key=key)
        fleet, network = Fleet(FleetConfig(Origin().geodetic, (config,))), MemoryNetwork(VirtualClock())
        network.attach(fleet)
        found = setup(fleet, network, remove=True)
        assert (fleet.vehicles[0].link.signed is None) is found.done is (key is KEY)
        assert found.failures() == ([] if key is KEY else ["vehicle 1 still signs"])
