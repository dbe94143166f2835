"""`python -m sim_vehicles` is `sim-vehicles`."""

from sim_vehicles.cli import main

main()
