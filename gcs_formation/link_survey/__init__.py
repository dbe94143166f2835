"""What links can do, measured without a flight: `gcs-formation link`.

The survey listens, sends the heartbeats of a ground station and TIMESYNC requests, and commands nothing. `survey` is
the engine, `measured_link` what is known of one vehicle's link, `report` its figures and the traces, `load` the probing
of capacity, `meaning` what they mean for a formation: a rehearsal with the traces under the virtual clock.
"""
