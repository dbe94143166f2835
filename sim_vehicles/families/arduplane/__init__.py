"""The emulated ArduPlane."""
