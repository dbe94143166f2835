from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlink.endpoint import Address, AirlinkError, Endpoint, EndpointError, parse_endpoint

hosts = st.ip_addresses(v=4).map(str)


@pytest.mark.parametrize(
    ("text", "endpoint"),
    [
        ("udpin:127.0.0.1:14550", Endpoint("udpin", Address("127.0.0.1", 14550))),
        ("udpout:192.168.1.20:14551", Endpoint("udpout", Address("192.168.1.20", 14551))),
        ("udp:0.0.0.0:14550", Endpoint("udpin", Address("0.0.0.0", 14550))),
        ("udpin://0.0.0.0:1", Endpoint("udpin", Address("0.0.0.0", 1))),
        ("udpout:autopilot.local:65535", Endpoint("udpout", Address("autopilot.local", 65535))),
    ],
)
def test_forms_that_pymavlink_and_mavproxy_users_write(text, endpoint):
    assert parse_endpoint(text) == endpoint


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("tcp:127.0.0.1:5760", "found 'tcp'"),
        ("/dev/ttyUSB0", "found '/dev/ttyUSB0'"),
        ("", "found ''"),
        ("udpin:14550", "host and port not found"),
        ("udpin::14550", "host and port not found"),
        ("udpin:::1:14550", "host and port not found, IPv6 isn't supported"),
        ("udpin:[::1]:14550", "host and port not found, IPv6 isn't supported"),
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


@given(st.sampled_from(("udpin", "udpout")), hosts, st.integers(1, 65535))
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
