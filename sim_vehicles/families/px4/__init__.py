"""The emulated PX4s: a fixed wing and a multirotor."""
