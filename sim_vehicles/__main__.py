"""`python -m sim_vehicles` is `sim-vehicles`."""

from __future__ import annotations

from airlink.cli import start


def main() -> None:
    """Run the command line."""
    start("sim_vehicles.cli")


if __name__ == "__main__":
    main()
