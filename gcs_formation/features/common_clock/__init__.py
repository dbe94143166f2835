"""A common clock: stamps of all vehicles on one time scale, by the UTC that most of them agree on.

**Problem.** A formation error compares a leader's and a follower's position *at one instant*. Each position is stamped
by its own autopilot's clock, and 100 ms of error at 22 m/s are 2.2 m along. Exchanging messages can't do better than
half of a round trip: the asymmetry of a delay is not observable from send and receive times alone (N. M. Freris, S. R.
Graham, P. R. Kumar, "Fundamental limits on synchronizing clocks over networks", IEEE Trans. Automatic Control 56(6),
2011). A link with 400 ms up and 80 ms down so puts a vehicle 3.5 m off.

**Method.** UTC of SYSTEM_TIME is read on board, with no link in it. But it may be absent, wrong by a constant, or have
left its receiver hours ago and drifted since. So each vehicle gives an *interval* for UTC minus the station's clock: by
causality no datagram arrives before it was sent, hence it is within plus or minus half of the shortest round trip of
the value for equal delays (`UtcBounds`). `agreed_s` looks for a value in more than half of these intervals, as NTP
tells falsetickers from truechimers (K. Marzullo, S. Owicki, "Maintaining the time in a distributed system", 1985; RFC
5905, 11.2.1), and takes the median of those that agree, clipped to the part that they have in common. In flight the
value is kept while a majority allows it, and changes by no more than 10 ms a second. A vehicle whose interval excludes
it flies by half round trips, with an event `clock`, and is trusted again only after 10 s without contradiction. What a
single clock's drift and age allow is decided before, in `gcs_formation/link/gnss_clock.py`.

**Why this.** The mean of all offsets would be moved by one clock that is off by 18 leap seconds. The first vehicle's
UTC, or the leader's, would make one receiver's fault everybody's. The station's own clock is right only where it is
kept by a receiver too (`telemetry.station_utc`); then it is used in place of the vote.

**Costs and limits.** A few comparisons for each vehicle and tick. The vote needs a majority: of two vehicles that
disagree neither is used. An error that causality allows, less than half of a round trip, stays unnoticed and costs
speed times error: 1.1 m for 50 ms at 22 m/s. An error common to all moves all alike and leaves formation errors as they
are, but not the measured delays up and down.

**Shown by** `tests/gcs_formation/features/common_clock/test_common_clock.py`; figures by `python -m
benchmarks.gnss_grid`, in docs/latency.md.
"""
