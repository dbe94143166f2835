from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.endpoint import Address, AirlinkError, Endpoint, EndpointError, parse_endpoint

BY_ID = "/dev/serial/by-id/usb-FTDI_0-if00"
hosts = st.ip_addresses().map(str)


@pytest.mark.parametrize(
    ("text", "endpoint"),
    [
        ("udpin:127.0.0.1:14550", Endpoint("udpin", Address("127.0.0.1", 14550))),
        ("udpout:192.168.1.20:14551", Endpoint("udpout", Address("192.168.1.20", 14551))),
        ("udp:0.0.0.0:14550", Endpoint("udpin", Address("0.0.0.0", 14550))),
        ("udpin://0.0.0.0:1", Endpoint("udpin", Address("0.0.0.0", 1))),
        ("udpout:autopilot.local:65535", Endpoint("udpout", Address("autopilot.local", 65535))),
        ("tcp:127.0.0.1:5760", Endpoint("tcp", Address("127.0.0.1", 5760))),
        ("tcpout://192.168.1.9:5760", Endpoint("tcp", Address("192.168.1.9", 5760))),
        ("tcpin:0.0.0.0:5760", Endpoint("tcpin", Address("0.0.0.0", 5760))),
        ("serial:/dev/ttyUSB0:57600", Endpoint("serial", Address("/dev/ttyUSB0", 57600))),
        ("serial:///dev/serial/by-id/usb-FTDI_0-if00:115200", Endpoint("serial", Address(BY_ID, 115200))),
        ("/dev/ttyACM0,115200", Endpoint("serial", Address("/dev/ttyACM0", 115200))),
        ("/dev/ttyUSB0", Endpoint("serial", Address("/dev/ttyUSB0", 57600))),
        ("COM7", Endpoint("serial", Address("COM7", 57600))),
        ("mcast:", Endpoint("mcast", Address("239.255.145.50", 14550))),
        ("mcast:239.1.2.3:14560", Endpoint("mcast", Address("239.1.2.3", 14560))),
        ("udpin:[::1]:14550", Endpoint("udpin", Address("::1", 14550))),
        ("tcp:[fe80::1]:5760", Endpoint("tcp", Address("fe80::1", 5760))),
    ],
)
def test_forms_that_pymavlink_and_mavproxy_users_write(text, endpoint):
    assert parse_endpoint(text) == endpoint


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("ble:127.0.0.1:5760", "found 'ble'"),
        ("udpbcast:127.0.0.255:14550", "mavlink-routerd -e 127.0.0.1:14550"),
        ("serial:ttyUSB0:57600", "device not found"),
        ("serial:/dev/ttyUSB0:0", "found 0 baud"),
        ("mcast:10.0.0.1:14550", "found 10.0.0.1; allowed: a group"),
        ("", "found ''"),
        ("udpin:14550", "host and port not found"),
        ("udpin::14550", "host and port not found"),
        ("udpin:::1:14550", "host and port not found"),
        ("udpin:[::g]:14550", "host and port not found"),
        ("udpout:a..b:14550", "host and port not found"),
        ("udpout: 127.0.0.1:14550", "host and port not found"),
        ("udpin:127.0.0.1:", "host and port not found"),
        ("udpin:127.0.0.1:x", "host and port not found"),
        ("udpin:127.0.0.1:-1", "host and port not found"),
        ("udpin:127.0.0.1:1²", "host and port not found"),
        ("udpin:127.0.0.1:0", "found port 0"),
        ("udpin:127.0.0.1:65536", "found port 65536"),
    ],
)
def test_other_forms_are_refused_with_what_was_found_and_what_is_allowed(text, found):
    with pytest.raises(EndpointError, match="allowed: ") as refused:
        parse_endpoint(text)
    assert found in str(refused.value)
    assert repr(text)[1:-1] in str(refused.value)
    assert isinstance(refused.value, AirlinkError)


@given(st.sampled_from(("udpin", "udpout", "tcp", "tcpin")), hosts, st.integers(1, 65535))
def test_a_connection_string_is_read_as_written(kind, host, port):
    endpoint = Endpoint(kind, Address(host, port))
    assert parse_endpoint(str(endpoint)) == endpoint


@given(st.text())
def test_any_other_text_raises_nothing_else(text):
    with suppress(EndpointError):
        parse_endpoint(text)


def test_the_opposite_end_reaches_who_listens_everywhere_by_loopback():
    assert str(parse_endpoint("udpin:0.0.0.0:14550").opposite()) == "udpout:127.0.0.1:14550"
    assert str(parse_endpoint("udpin:10.0.0.2:14550").opposite()) == "udpout:10.0.0.2:14550"
    assert str(parse_endpoint("udpout:10.0.0.2:14550").opposite()) == "udpin:10.0.0.2:14550"
    assert str(parse_endpoint("tcp:127.0.0.1:5762").opposite()) == "tcpin:127.0.0.1:5762"
    assert str(parse_endpoint("tcpin:0.0.0.0:5762").opposite()) == "tcp:127.0.0.1:5762"


def test_each_end_of_a_serial_line_is_the_others_peer():
    near = parse_endpoint("serial:/dev/ttyUSB0:57600")
    assert near.peer == near.opposite().address
    assert near.opposite().peer == near.address
    assert near.opposite().opposite() == near
