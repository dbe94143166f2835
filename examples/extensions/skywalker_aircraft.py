"""An aircraft: a named set of the keys of `model`, which may depend on keys of its own."""

from typing import Any

from pydantic import BaseModel, Field

from gcs_formation.extend import Aircraft, register_aircraft


@register_aircraft("skywalker")  # model: skywalker, or model: {aircraft: skywalker, parameters: {payload_kg: 1}}
class Skywalker(Aircraft):
    """A foam aircraft that is slower to change its speed the more it carries."""

    class Keys(BaseModel):
        """`parameters` beside `aircraft`."""

        payload_kg: float = Field(default=0.0, ge=0.0, le=2.0)

    def model(self) -> dict[str, Any]:
        """Return the keys of `model`."""
        return {"tau_v_s": 4.0 + self.keys.payload_kg, "tau_psi_s": 1.2, "speed_min_mps": 14.0 + self.keys.payload_kg}
