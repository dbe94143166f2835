"""Rigid bodies with six degrees of freedom, moved by a real autopilot's servo outputs.

`motion` integrates and senses, `fixed_wing` and `quadrotor` have the forces and moments; they are the aircraft of
ArduPilot's own simulator, so that its default gains fit.
"""
