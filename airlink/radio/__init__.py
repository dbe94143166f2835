"""Radios: one medium for all the datagrams of several vehicles, what happens on the air, and RADIO_STATUS.

A radio is one file under one interface: `impaired_link` and `proxy` know `shared_radio.SharedRadio` alone.
"""
