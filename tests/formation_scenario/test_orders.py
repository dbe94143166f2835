import math

import pytest

from formation_scenario.orders import OrderError, parse_order


def test_orders_are_words():
    line = parse_order(" shape   line 40 ")
    assert line.change is not None
    assert (line.text, line.change.shape, line.change.spacing_m, line.change.leader) == (
        "shape line 40",
        "line",
        40.0,
        None,
    )
    leader = parse_order("leader 2:3").change
    assert leader is not None
    assert (leader.shape, leader.leader) == (None, "2:3")
    assert parse_order("speed 24").speed_mps == 24.0
    assert parse_order("heading -90").heading_rad == pytest.approx(-math.pi / 2)
    assert [parse_order(word).end for word in ("loiter", "rtl", "land")] == ["loiter", "rtl", "land"]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", "found ''; allowed: shape NAME"),
        (
            "shap line",
            "found 'shap line'; allowed: shape NAME [SPACING_M], spacing SPACING_M, speed MPS, heading DEG, ",
        ),
        ("shape blob", "found shape 'blob'; allowed: follower, diamond"),
        ("shape diamon", "(did you mean 'diamond'?)"),
        ("shape line 0", "found '0'; allowed: a number of m, more than 0, up to 10000"),
        ("spacing -3", "found '-3'; allowed: a number of m, more than 0, up to 10000"),
        ("speed nan", "found 'nan'; allowed: a number from 0 to 1000 m/s"),
        ("speed -5", "found '-5'; allowed: a number from 0 to 1000 m/s"),
        ("speed", "found 'speed'"),
        ("heading north", "found 'north'; allowed: degrees clockwise from north, -360 to 360"),
        ("heading nan", "found 'nan'; allowed: degrees"),
        ("loiter now", "found 'loiter now'"),
        ("leader ²", "found vehicle '²'; allowed: a vehicle's id, or network:id"),
        ("leader 1:2:3", "found vehicle '1:2:3'"),
    ],
)
def test_what_is_no_order_is_refused_with_what_is(text, found):
    with pytest.raises(OrderError) as error:
        parse_order(text)
    assert found in str(error.value)


def test_planned_orders_are_checked_before_the_flight(refusal, load):
    assert load("orders=[{at_s: 5, order: shape line}]").orders[0].order == "shape line"
    (line,) = refusal("orders=[{at_s: 5, order: shape blob}]")
    assert line.startswith("orders.0.order: found 'shape blob'; shape NAME")
    assert refusal("orders=[{at_s: 5, order: leader 9}]") == ["orders.0.order: found 9; 1, 2, 3, 4"]
    (line,) = refusal("orders=[{at_s: 5, order: heading 90}]")
    assert line == "orders.0.order: found 'heading 90'; only of vehicles that hover"


def test_a_word_that_is_right_is_not_offered_again():
    with pytest.raises(OrderError, match=r"rtl, land$"):
        parse_order("shape")


@pytest.mark.parametrize(
    ("text", "said"), [("status extra", "rtl, land, status"), ("stats", "status (did you mean 'status'?)")]
)
def test_other_words_are_allowed_where_they_are_said(text, said):
    with pytest.raises(OrderError) as error:
        parse_order(text, ("status",))
    assert str(error.value).endswith(said)


def test_what_is_too_long_is_refused_and_not_cut():
    with pytest.raises(OrderError, match="up to 100 letters"):
        parse_order("speed 2" + 93 * " " + "5 metres")
