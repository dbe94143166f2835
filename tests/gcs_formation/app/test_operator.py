import signal

import pytest

from gcs_formation.app.operator_at_terminal import Interrupts


@pytest.mark.usefixtures("foreground")
def test_a_closed_terminal_asks_for_an_orderly_end_and_never_for_an_immediate_one() -> None:
    with Interrupts() as interrupts:
        signal.raise_signal(signal.SIGHUP)
        signal.raise_signal(signal.SIGHUP)
        assert interrupts.count == 1
        signal.raise_signal(signal.SIGINT)
        assert interrupts.count == 2


@pytest.mark.usefixtures("foreground")
def test_under_nohup_a_closed_terminal_is_nothing() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with Interrupts() as interrupts:
        signal.raise_signal(signal.SIGHUP)
        assert interrupts.count == 0
    assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
