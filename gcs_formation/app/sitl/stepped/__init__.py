"""`run --clock virtual --sitl FAMILY=PROGRAM`: a user's own autopilots, whose clocks are stepped by the run's.

`fleet` moves all in step and carries their MAVLink to the in-memory network, `flight` flies. What an autopilot and the
body that it commands exchange in each step is `gcs_formation.app.sitl.exchange`; its family opens it.
"""
