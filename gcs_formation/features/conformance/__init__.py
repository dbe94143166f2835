"""Conformance: does a vehicle do what it has acknowledged?

**Problem.** An acknowledgement says that a command was understood, not that it is flown. An autopilot may hold another
airspeed, ignore setpoints in the mode that it is in, or sink without power. The law compares a follower with where its
leader should be, and the separation rule counts on manoeuvres that are flown: both need to know within seconds who
doesn't conform, and neither may be disturbed by false alarms in turbulence.

**Method.** Fault detection by analytical redundancy: a model predicts the output from the input, and the residual is
tested (R. Isermann, "Fault-Diagnosis Systems", 2006, chapters 7 and 10). In air-traffic control this is conformance
monitoring (T. G. Reynolds, R. J. Hansman, "Investigating conformance monitoring issues in air traffic control using
fault detection techniques", Journal of Aircraft 42(5), 2005). `FlownSetpoints` takes the state at the beginning of a
sliding window of 3.2 s, lets equation (7) respond from there to the setpoints as sent, and compares the *change* of
each channel with the one flown. A channel fails a check if a large enough change was expected and more than three
quarters of it are missing; four failures in a row are an event `disobeys`, eight checks without one `obeys`. Two in a
row make a vehicle *doubted*, and the separation rule then looks for it at more than one position. What other reasons
explain is taken off first: turns and speed changes under way, airspeed traded for height under total-energy control,
and vertical air, whose variance is estimated from the same residuals. Beside motion, `ConformanceMonitor` judges
answers, refusals and the effects of mode changes, as each has a cause and a remedy of its own.

**Why this.** The residual of the whole state since the last command would accumulate the errors of model and wind; over
a window they stay small. A bound on the distance from the commanded path would report the wind and the law's own
errors, and says nothing while a vehicle happens to be on its path. An innovation test of the state filter sees noise
and jumps, but a filter that tracks telemetry follows a vehicle that flies elsewhere just as well.

**Costs and limits.** One simulation of 3.2 s for each vehicle every 0.4 s. Only commanded changes show anything: in
straight flight at constant height every vehicle conforms, so nothing is found until the next change. A slow sinking
within what rising and sinking air explains is found late (`SUNK_M`, `CHECKS_STUCK`). What ignores its setpoints is
reported some 5 s after the change began.

**Shown by** `tests/gcs_formation/features/conformance/test_monitor.py` (each rule by itself, on made-up motion) and
`test_flights.py` there (whole flights: turbulence and noise aren't reported, ignored setpoints are).
"""
