"""Keeps fixed wings clear of one another from the ground until the formation is commanded.

They stand in lines and take off side by side, so they keep their distances as long as all do the same at once. Over a
link that loses frames they don't: a command that has to be repeated comes seconds later than to the others. So one
that took off first from behind flew over another that still stood (7.5 m at 10 % loss), and one in guided mode that
waited for its leader without a setpoint circled, into the one that still climbed out beside it (2.9 m at 30 %). Of 40
take-offs of four at 30 % the nearest vehicles came within 2.3 m, and within 25.7 m with what is here.

Therefore none is armed before all are ready to be, and those ahead on its line are armed. Those that wait for the
formation fly straight on, at most for `awaiting.STRAIGHT_S`; then they circle, each at a height of its own, until all
are there.
"""
