"""What bad links may do to a formation: flown against emulated vehicles, byte for byte the same in every run."""


def test_a_late_and_lossy_link(formation):
    """With 300 ms and 2 % loss on vehicle 3 the formation stays within 1 m."""
    flight = formation("diamond.yaml").with_link(vehicle=3, delay_ms=300, loss=0.02).fly(until=60)
    flight.stays_within(1.0, axes="xy", from_s=30)


def test_losses_in_bursts(formation):
    """With a fifth of all datagrams lost, five in a row, no vehicle is 1 m off, and every follower settles."""
    flight = formation("diamond.yaml").with_link(loss=0.2, mean_burst=5, jitter_ms=20).fly(until=60)
    flight.stays_within(1.0, from_s=20).settles(before_s=20)


def test_an_outage_affects_one_vehicle_only(formation):
    """While vehicle 4 receives nothing for 10 s, the others keep their slots; afterwards it comes back to its own."""
    flight = formation("diamond.yaml").with_outage(vehicle=4, from_s=20, to_s=30).fly(until=60)
    flight.stays_within(0.1, followers=[2, 3]).keeps_apart(20)
    flight.stays_within(1.0, followers=4, from_s=50)
