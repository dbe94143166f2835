"""Conflict resolution: no two vehicles come too near, whatever the law commands.

**Problem.** The law minimises formation errors and knows nothing of distances. Changes of shape, a pilot who turns off,
a vehicle that receives nothing and gusts bring vehicles together. A rule on top of the law must act in time for
aircraft that turn at 0.25 rad/s and climb at 3 m/s, over links with seconds of delay, and must not act at all in close
formation, where neighbours are always near.

**Method.** Run-time assurance with a backup manoeuvre (the simplex architecture: L. Sha, "Using simplicity to control
complexity", IEEE Software 18(4), 2001; backup control barrier functions, see docs/separation.md). A setpoint passes,
bit for bit, if after it has acted a manoeuvre is left that keeps every distance over the horizon of 12 s. If none is
left, such a manoeuvre is flown now: at the commanded height or another, straight on or along the leader's velocity; for
multirotors also to stop or to move to a side. Vehicles choose one after another, each against the trajectories already
chosen (M. Erdmann, T. Lozano-Pérez, "On multiple moving objects", Algorithmica 2, 1987), the last follower first, so
that symmetric encounters have one outcome. Vehicles that may not respond are looked for at every position at which they
may be (`non_conforming`).

A tick's check has three steps, each only where the one before leaves a doubt: `broad_phase` bounds how far each vehicle
can get; `approach` finds the closest approach of commanded trajectories; `conflict_resolution` searches manoeuvres
among those that could come near. `resolver` builds their input from the tick and applies their decision.

**Why this.** A repulsive potential, or a barrier on the present distance, acts on vehicles that fly side by side and
fights the formation. Reciprocal velocity obstacles ask for velocities at once, which aircraft can't change at once.
Optimising all trajectories together costs hundreds of milliseconds and has no answer when the solver doesn't converge;
here the trajectories of the last tick are always among the candidates, so a safe set leads to a safe set.

**Costs and limits.** 0.06 to 1 ms a tick with nothing in the way, 3 to 6 ms for each vehicle that manoeuvres (`python
-m benchmarks.features.separation`). The argument for safety is for two vehicles and states as predicted. Encounters
that begin with too little time, pilots that turn in the last seconds and gusts beyond the model's come nearer:
docs/separation.md has the figures, under "Limits". Detours aren't found: two sent to one position stay one above the
other.

**Shown by** `tests/gcs_formation/features/separation/`: `test_conflict_resolution.py` (encounters by model (7), random
ones among them), `test_flights.py` (whole flights over MAVLink).
"""
