"""Steps of height may not lead into the ground."""

import pytest

LOW = "path.waypoints_m=[[0, 0, 40], [4000, 0, 40]]"
BEGIN = "path.steps.0.height_m: at"


def step(**keys: float) -> str:
    each = {"at_s": 5, "for_s": 30} | keys
    return ", ".join(f"{name}: {value}" for name, value in each.items())


@pytest.mark.parametrize(
    ("steps", "found"),
    [
        ([step(height_m=-50)], f"{BEGIN} 5 s (north 110, east 0, height 40) the leader is -10.0 m above the ground"),
        ([step(height_m=-35)], ""),
        # At its middle the step is complete for a moment, or as far as its ramp has brought it.
        ([step(height_m=-36, ramp_s=15)], f"{BEGIN} 20 s (north 440, east 0, height 40) the leader is 4.0 m above"),
        ([step(height_m=-48, ramp_s=20)], f"{BEGIN} 20 s (north 440, east 0, height 40) the leader is 4.0 m above"),
        # Steps add up where they overlap, from 20 to 35 s.
        ([step(height_m=-20), step(at_s=20, height_m=-18)], "path.steps.0.height_m: at 20"),
        ([step(height_m=-20), step(at_s=35, height_m=-18)], ""),
        ([step(height_m=-30), step(height_m=20), step(height_m=-20)], ""),
        ([step(at_s=500, height_m=-50)], ""),
        ([step(height_m=50, speed_mps=2)], ""),
    ],
)
def test_steps_that_lead_into_the_ground_are_refused_with_time_and_position(load, refusal, steps, found):
    """The leader flies 40 m high over a plain at 22 m/s; 5 m are asked for. Nothing after the end counts."""
    given = f"path.steps=[{', '.join(f'{{{each}}}' for each in steps)}]"
    if found:
        (line,) = refusal(LOW, given)
        assert line.startswith(found)
        assert line.endswith("m above the ground; 5 m or more (safety.clearance_m)")
    else:
        assert load(LOW, given)


def test_the_lowest_slot_goes_down_with_the_leader(load, refusal):
    below = "formation={shape: custom, slots_m: {2: [-30, 0, -20], 3: [-60, 0, 0], 4: [-90, 0, 5]}}"
    assert load(LOW, below, f"path.steps=[{{{step(height_m=-14)}}}]")
    (line,) = refusal(LOW, below, f"path.steps=[{{{step(height_m=-16)}}}]")
    assert "the lowest slot is 4.0 m above the ground" in line


def test_over_terrain_steps_are_held_against_the_ground_below(refusal):
    """A hill of 30 m at 1100 m, which the leader reaches after 50 s, is cleared by 10 m without any step."""
    hill = "{north_m: 1100, east_m: 0, height_m: 30, radius_m: 200}"
    (line,) = refusal(
        LOW, f"terrain={{clearance_m: 8, hills: [{hill}]}}", f"path.steps=[{{{step(at_s=30, height_m=-6)}}}]"
    )
    assert line.startswith(f"{BEGIN} 50")
    assert "(north 110" in line
    assert "the leader is 4.0 m above the ground" in line
