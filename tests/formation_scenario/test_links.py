def test_a_clean_link_has_one_state(load):
    scenario = load()
    (step,) = scenario.link_steps(scenario.vehicles[0])
    assert step.at_s == 0.0
    assert step.uplink == step.downlink
    assert (step.uplink.delay_ms, step.uplink.loss, step.uplink.distribution) == (0.0, 0.0, "normal")


def test_a_direction_differs_from_the_default_only_where_it_says_so(load):
    scenario = load("links.default={delay_ms: 50, uplink: {loss: 0.1}}", "links.downlink={delay_ms: 80}")
    (step,) = scenario.link_steps(scenario.vehicles[0])
    assert (step.uplink.delay_ms, step.uplink.loss) == (50.0, 0.1)
    assert (step.downlink.delay_ms, step.downlink.loss) == (80.0, 0.0)


def test_changes_build_on_the_state_before_them_in_time_order(load):
    scenario = load(
        "links.changes=[{at_s: 40, vehicles: [2], downlink: {delay_ms: 0}},"
        " {at_s: 20, vehicles: [2, 3], delay_ms: 300, loss: 0.2}, {at_s: 60, loss: 0}]"
    )
    steps = scenario.link_steps(scenario.vehicles[1])
    assert [step.at_s for step in steps] == [0.0, 20.0, 40.0, 60.0]
    assert [step.uplink.delay_ms for step in steps] == [0.0, 300.0, 300.0, 300.0]
    assert [step.downlink.delay_ms for step in steps] == [0.0, 300.0, 0.0, 0.0]
    assert [step.downlink.loss for step in steps] == [0.0, 0.2, 0.2, 0.0]
    assert [step.at_s for step in scenario.link_steps(scenario.vehicles[3])] == [0.0, 60.0]
