"""Slows the leader down while a multirotor can't reach the speed that it is commanded: it is saturated.

A multirotor flies a velocity over ground, as far as its tilt allows it through the air: against a wind of 6 m/s one
that reaches 10.7 m/s through the air has 4.7 m/s left. Neither is reported. So it is seen by its motion: one that is
commanded to be faster, and neither is nor becomes so, is at its limit, and what it flies is that limit. A formation
whose leader flies as fast as it can falls apart, for its followers have nothing left to correct with; so does one that
changes its shape, where slots are faster than the leader. So the leader leaves them `RESERVE_MPS`, and as much as their
slots are faster.

The limit is forgotten slowly, for the wind and the course change; it is found again by the next saturation.
"""
