"""Flights as test cases: a pytest plugin whose fixture `formation` flies scenarios and checks the results.

    def test_a_late_link(formation):
        flight = formation("scenario.yaml").with_link(vehicle=3, delay_ms=300, loss=0.02).fly(until=60)
        flight.stays_within(1.0, axes="xy", from_s=30)

pytest finds the plugin by itself if this package is installed. The source tree has whole tests in examples/.
"""
