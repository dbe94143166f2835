"""Datagrams to attributed, measured links: discovery, connections, clocks, loss."""
