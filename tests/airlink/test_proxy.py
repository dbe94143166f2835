import signal
import socket
import subprocess
import sys
from typing import Any

import pytest
from click.testing import CliRunner

import airlink.proxy
from airlink.cli.proxy import KEYS, Console, apply_line, changed, described, main, summary
from airlink.clock import Instant, after
from airlink.endpoint import Address, Endpoint, ImpairmentError, PortError
from airlink.impairment import UNIMPAIRED, Direction, Impairment
from airlink.proxy import Proxy
from airlink.radio.settings import RadioSettings
from airlink.relay import Relay
from airlink.transports.udp import MAX_DATAGRAM, open_socket

UP, DOWN = Direction.UPLINK, Direction.DOWNLINK
ANY_PORT = ("127.0.0.1", 0)


def udp_socket():
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    opened.bind(ANY_PORT)
    opened.settimeout(120.0)
    return opened


@pytest.fixture
def listen():
    """Return an endpoint with a free port."""
    with udp_socket() as probe:
        return Endpoint("udpin", Address(*probe.getsockname()))


def arrives(opened):
    opened.setblocking(False)

    def check():
        try:
            return bool(opened.recv(1, socket.MSG_PEEK))
        except BlockingIOError:
            return False

    return check


def test_every_remote_has_its_own_path_there_and_back(listen):
    relay = Relay(1)
    relay.impairments[DOWN] = Impairment(delay_s=0.01)
    with udp_socket() as ground, udp_socket() as first, udp_socket() as second:
        target = Endpoint("udpout", Address(*ground.getsockname()))
        with Proxy(listen, target, relay) as proxy:
            remotes = []
            for vehicle, word in ((first, b"a"), (second, b"b"), (first, b"c")):
                vehicle.sendto(word, listen.address.pair)
                proxy.run(arrives(ground))
                data, remote = ground.recvfrom(10)
                assert data == word
                remotes.append(remote)
            assert remotes[0] == remotes[2] != remotes[1]
            ground.sendto(b"answer", remotes[1])
            proxy.run(arrives(second))
            assert second.recvfrom(10) == (b"answer", listen.address.pair)
    assert relay.statistics(DOWN).datagrams == 3
    assert relay.statistics(DOWN).mean_delay_s == pytest.approx(0.01)
    assert (
        summary(relay)
        == "uplink: 1 datagrams, 0 lost, mean delay 0.0 ms; downlink: 3 datagrams, 0 lost, mean delay 10.0 ms"
    )


def test_behind_one_radio_datagrams_of_all_remotes_arrive_in_each_ones_order_after_their_air_time(listen):
    relay = Relay(1, RadioSettings(8e4, 8e4))
    with udp_socket() as ground, udp_socket() as first, udp_socket() as second:
        with Proxy(listen, Endpoint("udpout", Address(*ground.getsockname())), relay) as proxy:
            for word in (b"1", b"2"):
                first.sendto(100 * word, listen.address.pair)
                second.sendto(300 * word, listen.address.pair)
            proxy.run(lambda: relay.statistics(DOWN).delivered == 4 and relay.under_way.next() is None)
        found = [ground.recv(400) for _ in range(4)]
    for size in (100, 300):
        assert [each[:1] for each in found if len(each) == size] == [b"1", b"2"]
    assert relay.statistics(DOWN).mean_delay_s >= (0.01 + 0.01 + 0.03 + 0.03) / 4


def test_of_too_many_remotes_the_one_silent_longest_is_forgotten(listen, monkeypatch):
    """Its datagrams in transit are lost, its counts stay, and it may come back."""
    monkeypatch.setattr(airlink.proxy, "MAX_REMOTES", 2)
    relay = Relay(1)
    with udp_socket() as ground, udp_socket() as talking, udp_socket() as silent, udp_socket() as new:
        target = Endpoint("udpout", Address(*ground.getsockname()))
        with Proxy(listen, target, relay) as proxy:

            def passes(vehicle, word):
                vehicle.sendto(word, listen.address.pair)
                arrived, wake_ups = arrives(ground), iter(range(100))
                proxy.run(lambda: arrived() or next(wake_ups, None) is None)
                data, remote = ground.recvfrom(10)
                assert data == word
                return remote

            first, gone = passes(talking, b"a"), passes(silent, b"b")
            assert passes(talking, b"c") == first
            third = passes(new, b"d")
            assert len({first, gone, third}) == 3
            assert passes(talking, b"e") == first
            relay.under_way.push(Instant(0), (1, UP, b"late"))
            ground.sendto(b"answer", third)
            proxy.run(arrives(new))
            assert new.recvfrom(10) == (b"answer", listen.address.pair)
            assert passes(silent, b"f") != gone
            assert not arrives(silent)()
    assert (relay.statistics(DOWN).datagrams, relay.statistics(UP).datagrams) == (6, 1)


def test_lines_are_read_to_their_end_and_no_further(listen):
    reading, writing = socket.socketpair()
    taken = list[bytes]()
    with reading, writing, Proxy(listen, Endpoint("udpout", Address("127.0.0.1", 9)), Relay(1)) as proxy:
        proxy.watch(reading.fileno(), taken.append)
        writing.sendall(b"loss 1\n")
        proxy.run(lambda: bool(taken))
        writing.shutdown(socket.SHUT_WR)
        proxy.run(lambda: taken[-1] == b"")
    assert b"".join(taken) == b"loss 1\n"


def test_an_unknown_host_is_named(listen, monkeypatch):
    def unknown(host):
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "gethostbyname", unknown)
    with pytest.raises(PortError, match="cannot send to udpout:nowhere:9: Name or service not known"):
        Proxy(listen, Endpoint("udpout", Address("nowhere", 9)), Relay(1))


def test_each_remotes_datagrams_meet_their_own_numbers_in_both_directions():
    relay = Relay(3)
    relay.impairments.update(dict.fromkeys(Direction, Impairment(1.0, 0.1)))
    passages = [(remote, direction, b"x") for direction in Direction for remote in (0, 1)]
    for passage in passages:
        relay.accept(passage, Instant(0))
    came = []
    while (timer := relay.under_way.next()) is not None:
        came += [(timer, passage) for passage in relay.under_way.pop_due(timer)]
    assert sorted(passage for _, passage in came) == sorted(passages)
    assert len({timer for timer, _ in came}) == 4


def test_a_relay_hands_on_nothing_too_early():
    relay = Relay(1)
    apply_line(relay.impairments, "uplink delay-ms 250")
    relay.accept((0, UP, b"x"), Instant(0))
    assert relay.under_way.pop_due(after(Instant(0), 0.2499)) == []
    assert relay.under_way.pop_due(after(Instant(0), 0.25)) == [(0, UP, b"x")]


@pytest.mark.parametrize(
    ("line", "uplink", "downlink"),
    [
        ("delay-ms 300", Impairment(delay_s=0.3), Impairment(delay_s=0.3)),
        ("downlink loss 0.1", UNIMPAIRED, Impairment(loss=0.1)),
        ("uplink  outage   on", Impairment(outage=True), UNIMPAIRED),
        ("rate-kbps 57.6", Impairment(rate_bps=57600.0), Impairment(rate_bps=57600.0)),
        ("uplink mean-burst 3", Impairment(mean_burst=3.0), UNIMPAIRED),
        ("reorder off", Impairment(reorder=False), Impairment(reorder=False)),
        ("downlink distribution pareto", UNIMPAIRED, Impairment(distribution="pareto")),
    ],
)
def test_a_line_changes_what_it_names(line, uplink, downlink):
    impairments = dict.fromkeys(Direction, UNIMPAIRED)
    apply_line(impairments, line)
    assert impairments == {UP: uplink, DOWN: downlink}


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("delay 3", "found key 'delay'; allowed: delay-ms, jitter-ms"),
        ("loss 1.5", "loss: found '1.5'; allowed: 0 to 1"),
        ("loss nan", "loss: found 'nan'; allowed: 0 to 1"),
        ("downlink delay-ms -1", "delay-ms: found '-1'; allowed: 0 to 600000"),
        ("rate-kbps 1e-300", "rate-kbps: found '1e-300'; allowed: 0, or 0.001 to 1000000"),
        ("distribution trace", "distribution: found 'trace'; allowed: normal, uniform, pareto"),
        ("outage maybe", "outage: found 'maybe'; allowed: on, off"),
        ("uplink", "found 'uplink'; allowed: [uplink|downlink] KEY VALUE"),
        ("sideways loss 0.1", "found 'sideways loss 0.1'; allowed: [uplink|downlink] KEY VALUE"),
    ],
)
def test_a_bad_line_changes_nothing_and_is_answered_with_what_is_allowed(line, answer, capsys):
    relay = Relay(1)
    Console(relay).feed(line.encode() + b"\n")
    assert capsys.readouterr().out.startswith(f"error: {answer}")
    assert relay.impairments == dict.fromkeys(Direction, UNIMPAIRED)
    with pytest.raises(ImpairmentError):
        apply_line(relay.impairments, line)


@pytest.mark.parametrize("rate", ["0.001", "0", "0.0"])
def test_the_longest_datagram_arrives_at_any_rate(rate):
    relay = Relay(1)
    apply_line(relay.impairments, f"rate-kbps {rate}")
    relay.accept((0, UP, bytes(MAX_DATAGRAM)), Instant(0))
    arrival = relay.under_way.next()
    assert arrival == after(Instant(0), 8.0 * MAX_DATAGRAM if rate == "0.001" else 0.0)


def test_every_line_is_answered_with_what_is_set(capsys):
    relay = Relay(1)
    console = Console(relay)
    console.feed(b"delay-ms 300\n\nuplink lo")
    console.feed(b"ss 0.25")
    console.feed(b"")
    uplink, downlink = capsys.readouterr().out.splitlines()[-2:]
    assert uplink.startswith("uplink: delay-ms 300, jitter-ms 0, distribution normal, loss 0.25,")
    assert downlink.startswith("downlink: delay-ms 300, jitter-ms 0, distribution normal, loss 0,")


def test_what_is_shown_can_be_set_again():
    wanted = Impairment(0.25, 0.05, "pareto", 0.1, 3.0, 0.2, 57600.0, 0.5, False, True)
    impairment = UNIMPAIRED
    for setting in described(wanted).split(", "):
        impairment = changed(impairment, *setting.split())
    assert impairment == wanted
    assert len(KEYS) == len(described(wanted).split(", "))


def proxy_command(listen, *options):
    ends = ["--listen", str(listen), "--to", "udpout:127.0.0.1:9"]
    return CliRunner().invoke(main, [*ends, *options])


@pytest.mark.parametrize(
    ("options", "found"),
    [
        (["--loss", "2"], "--loss: found '2'; allowed: 0 to 1"),
        (["--rate-kbps", "1e-300"], "--rate-kbps: found '1e-300'; allowed: 0, or 0.001 to 1000000"),
        (["--uplink-delay-ms", "x"], "--uplink-delay-ms: found 'x'; allowed: 0 to 600000"),
        (["--to", "http:127.0.0.1:9"], "found 'http'; allowed: udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT"),
        (["--to", "udpout:127.0.0.1"], "host and port not found"),
        (["--seed", "-1"], "--seed"),
    ],
)
def test_bad_usage_is_status_2_with_what_is_allowed(listen, options, found):
    result = proxy_command(listen, *options)
    assert result.exit_code == 2
    assert found in result.output


@pytest.mark.parametrize(
    ("listening", "to"),
    [("127.0.0.1", "127.0.0.1"), ("127.0.0.1", "localhost"), ("localhost", "0.0.0.0"), ("0.0.0.0", "127.0.0.1")],
)
def test_its_own_port_is_refused_as_a_target(listen, listening, to):
    port = listen.address.port
    result = CliRunner().invoke(main, ["--listen", f"udpin:{listening}:{port}", "--to", f"udpout:{to}:{port}"])
    assert result.exit_code == 2
    assert f"--to: found udpout:{to}:{port}, where we listen ourselves; allowed: where a ground" in result.output
    with open_socket(listen):
        pass


def test_the_same_port_of_another_machine_is_a_target(listen):
    with Proxy(listen, Endpoint("udpout", Address("192.0.2.1", listen.address.port)), Relay(1)):
        pass
    anywhere = Endpoint("udpin", Address("0.0.0.0", listen.address.port))
    with Proxy(anywhere, Endpoint("udpout", Address("192.0.2.1", listen.address.port)), Relay(1)):
        pass


@pytest.mark.usefixtures("foreground")
def test_an_interrupt_ends_it_with_a_summary_and_status_130(listen):
    command = [sys.executable, "-c", "from airlink.cli.proxy import main; main()"]
    ends = ["--listen", str(listen), "--to", "udpout:127.0.0.1:9", "--delay-ms", "5"]
    pipes: Any = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    process: Any
    with subprocess.Popen([*command, *ends], **pipes) as process:
        process.stdin.write("downlink loss 1\n")
        process.stdin.flush()
        answer = [process.stdout.readline() for _ in Direction]
        process.send_signal(signal.SIGINT)
        rest = process.stdout.read()
    assert answer[1].startswith("downlink: delay-ms 5, jitter-ms 0, distribution normal, loss 1,")
    assert rest == "uplink: 0 datagrams, 0 lost; downlink: 0 datagrams, 0 lost\n"
    assert process.returncode == 130


def test_a_taken_port_is_status_3(listen):
    with open_socket(listen):
        result = proxy_command(listen)
    assert result.exit_code == 3
    assert f"{listen.address} is taken" in result.output
