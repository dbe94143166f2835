"""A fault: ice on the wings makes an aircraft slower, and its airspeed sensor read less."""

from pydantic import BaseModel, Field

from gcs_formation.extend import EmulatedVehicle, Measured, VehicleFault, register_fault


@register_fault("icing")  # faults: [{kind: icing, at_s: 30, until_s: 60, vehicles: [3], parameters: {share: 0.8}}]
class Icing(VehicleFault):
    """Takes a share of the highest airspeed, and of the one that is measured."""

    class Keys(BaseModel):
        """`parameters` beside `kind`."""

        share: float = Field(default=0.85, gt=0.0, le=1.0)

    def strike(self, vehicle: EmulatedVehicle) -> None:
        """Begin: the vehicle says so too."""
        vehicle.limit(speed_max_mps=self.keys.share * 28.0)
        vehicle.say("ice on the wings")

    def end(self, vehicle: EmulatedVehicle) -> None:
        """End: its limits are as they were."""
        vehicle.limit()

    def measure(self, measured: Measured, time_s: float) -> Measured:
        """Return what telemetry has while it lasts."""
        del time_s  # it is the same at all times
        return measured._replace(airspeed_mps=self.keys.share * measured.airspeed_mps)
