"""`run --sitl FAMILY=PROGRAM`: a user's own ArduPilot or PX4 simulators in place of the emulated vehicles.

`simulator` says what a family brings, `families` has them, `fleet` derives each vehicle's simulator from the scenario,
`processes` starts and ends them, `truth` reads where they were from their logs, and `flight` flies.
"""
