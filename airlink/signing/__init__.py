"""Signed frames of MAVLink 2: who has a link's key is who may speak on it.

A signature is appended to a frame: the link's id, a timestamp of 10 µs since 2015, and the first 48 bits of the SHA-256
of the key and all of that. What is repeated is distinguished from what is new by the timestamp, which grows from frame
to frame of a stream: of one component, on one of its links.

- `signature`: the bytes, appended, verified, removed; `key`: a key, and the file that it comes from;
- `authentication`: what one key has seen, and its verdict on a frame; `kept_timestamps` carries that over restarts;
- `signed_links`: an engine's links, each with its key or none, and what was refused on them;
- `setup`: hands a key to vehicles (SETUP_SIGNING), on request alone.

Source: MAVLink guide, "Message Signing"; ArduPilot, `GCS_Signing.cpp`; pymavlink is the tests' other end.
"""
