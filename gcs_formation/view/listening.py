"""The socket on which the page is served: opened by who starts the viewer, so that a taken port is known at once."""

from __future__ import annotations

import socket

BACKLOG = 64


def listening_socket(host: str, port: int) -> socket.socket:
    """Return a socket that listens there; port 0 is a free one.

    Raises:
        OSError: the port is taken, or the address isn't this machine's.
    """
    opened = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM)
    try:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        opened.bind((host, port))
        opened.listen(BACKLOG)
    except OSError:
        opened.close()
        raise
    return opened
