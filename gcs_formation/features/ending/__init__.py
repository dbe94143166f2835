"""The end of a flight: from close formation to vehicles that circle, return or land, each for itself.

**Problem.** While the formation is commanded, the law and the separation rule keep vehicles apart. A command to loiter,
return or land ends that for each vehicle *when it arrives*, and then an autopilot turns off on a circle of its own,
with no one to see the others. Commands get lost, are refused, or reach one vehicle seconds after the next: where the
uplink was out for 3.5 s, vehicles sent to circle at once came within 1.3 m of each other (docs/separation.md, "At the
end of a flight").

**Method.** Procedural vertical separation, as in a holding stack (ICAO Doc 4444, PANS-ATM, chapters 5 and 6):
separation that needs no cooperation, because levels differ wherever the aircraft are.

1. `HoldingStack` gives every vehicle that could meet another a level of its own, `STACK_M` or what turbulence needs
   apart; none has to sink to get there, and levels between which a vehicle may be that doesn't answer are left to it.
2. `VerticalSeparation` flies the formation on, by the law, to these levels. Hovering vehicles are first stopped
   together.
3. It ends when it no longer matters who receives the next command, or at a time limit that follows from the climb. Only
   then does `SeparatedEnding` send the commands, again and again until they are acknowledged *and* seen to act.
4. To land, vehicles circle over their homes and come down one by one, the lowest first (`landings`, `landing_order`).
   None goes home that refuses its level there: it circles where it is.

**Why this.** Lateral separation would be cheaper in time, but needs circles whose radius, side and centre the station
knows; autopilots choose these by parameters and wind. The separation rule can't go on: it needs setpoints that are
flown. To send all commands at once is what came to 1.3 m.

**Costs and limits.** 8 to 24 s of flight before the first circle (30 s at least are allowed, 300 s at most). More
vehicles make a higher stack: fifty at 15 m need 735 m. At the time limit vehicles leave though not all are apart, and
`at_one_height` names the pairs that may circle at one height; the run then fails with exit status 1. A vehicle that
receives nothing for longer than `FORGOTTEN_AFTER_S` isn't counted any more.

**Shown by** `tests/gcs_formation/features/ending/` and, with links that fail and vehicles that refuse at the last
moment, `tests/flights/test_end_of_flight.py`; figures by `python -m benchmarks.endings`.
"""
