"""A process that ends simulators whose ground station has died: numbers of processes come on its input.

Its argument is `airlink.host_system.STATUS_OF_PROCESS`.

A station that is killed can't end what it has started, and the next run would find its ports taken, by vehicles that
fly on. Its end closes this process's input, which is noticed here, whatever the operating system. It runs as a script,
without the packages around it, so that it is up before the first simulator.
"""

import os
import signal
import sys
import time
from contextlib import suppress

END_S = 10.0
"""Time that a simulator gets to close its log, s."""
LOOK_S = 0.05


def ours(process: int, status: str) -> bool:
    """Return whether a process still runs: each simulator leads a process group, another by its number hardly does."""
    with suppress(OSError):
        return os.getpgid(process) == process and not _is_dead(process, status)
    return False


def _is_dead(process: int, status: str) -> bool:
    """Return whether it has ended, and only waits for somebody to read its exit status; unknown counts as no."""
    with suppress(OSError), open(status.format(process), "rb") as file:  # noqa: PTH123 - nothing but os is imported
        return file.read().rpartition(b")")[2].split()[0] == b"Z"
    return False


def end(processes: list[int], status: str) -> None:
    """End them: asked to, and killed where they don't."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        for process in processes:
            if ours(process, status):
                with suppress(OSError):
                    os.kill(process, number)
        # Real time and sleep, as processes of the machine are waited for; no flight has a clock here.
        until = time.monotonic() + END_S
        while any(ours(each, status) for each in processes) and time.monotonic() < until:
            time.sleep(LOOK_S)


if __name__ == "__main__":
    end([int(line) for line in sys.stdin], sys.argv[1])
