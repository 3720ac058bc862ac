"""What a battery and diagnostics say, without ROS: messages that any node may have made."""

import math
from types import SimpleNamespace

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.actions import MAX_STATUS_ITEMS, StatusItem, fits_kind
from lockstep.robot_bridge.robots.ros2.sensing.battery import Charge, charge_of
from lockstep.robot_bridge.robots.ros2.sensing.diagnostics import FORGOTTEN, KEPT, Components
from lockstep.robot_bridge.robots.ros2.sensing.words import words_of


def battery(**parts: float) -> SimpleNamespace:
    unknown = dict.fromkeys(("percentage", "charge", "capacity", "voltage"), math.nan)
    return SimpleNamespace(**{**unknown, "power_supply_status": 0, "power_supply_health": 0, **parts})


@pytest.mark.parametrize(
    ("parts", "charge"),
    [
        ({"percentage": 0.5, "voltage": 24.0}, Charge(0.5, 24.0, False, "")),
        ({"percentage": 1.01}, Charge(1.0, None, False, "")),
        ({"percentage": -0.2}, Charge(0.0, None, False, "")),
        ({"charge": 2.0, "capacity": 8.0}, Charge(0.25, None, False, "")),
        ({"charge": 2.0, "capacity": 0.0}, Charge(None, None, False, "")),
        ({"voltage": 12.5, "power_supply_status": 1}, Charge(None, 12.5, True, "")),
        ({"percentage": 0.9, "power_supply_health": 2}, Charge(0.9, None, False, "it is too hot")),
        ({"voltage": math.inf}, Charge(None, None, False, "")),
    ],
)
def test_a_battery_says_what_it_measures(parts: dict[str, float], charge: Charge) -> None:
    assert charge_of(battery(**parts)) == charge


def test_components_are_shown_worst_first_and_the_rest_are_counted() -> None:
    components = Components(most=2, old_after=10.0)
    for name, level in (("a", 0), ("b", 2), ("c", 1), ("d", 3)):
        components.take(name, level, "", 0.0)
    items = components.items(4.0)
    assert [(item.label, item.level, item.value) for item in items] == [
        ("b", "error", "error"),
        ("c", "warning", "warning"),
        ("Diagnostics", "ok", "2 more, none worse than these"),
    ]
    assert items[0].age == 4.0
    components.take("b", 0, "", 5.0)
    assert [item.label for item in components.items(5.0)][:2] == ["c", "d"]


def test_a_component_that_is_silent_is_forgotten_after_a_while() -> None:
    components = Components(most=5, old_after=1.0)
    components.take("gone", 2, "x", 0.0)
    components.take("here", 0, "", FORGOTTEN)
    assert [item.label for item in components.items(FORGOTTEN + 0.1)] == ["here"]


def test_names_without_end_take_no_more_room() -> None:
    components = Components(most=40, old_after=1.0)
    for number in range(3 * KEPT):
        components.take(f"node {number}", 2, "x", 0.0)
    items = components.items(0.0)
    assert len(items) == 41
    assert items[-1].value == f"{KEPT - 40} more, none worse than these"


@given(
    st.lists(st.tuples(st.text(), st.integers(-300, 300), st.text(), st.floats(0, 1e6)), max_size=80),
    st.integers(1, 40),
)
def test_whatever_is_said_a_console_takes_it(said: list[tuple[str, int, str, float]], most: int) -> None:
    components = Components(most, old_after=5.0)
    for name, level, message, now in sorted(said, key=lambda each: each[3]):
        components.take(name, level, message, now)
    items = components.items(1e6)
    assert len(items) <= MAX_STATUS_ITEMS
    assert len({item.name for item in items}) == len(items)
    for item in items:
        assert msgspec.convert(msgspec.to_builtins(item), StatusItem) == item
        assert fits_kind(item)


@given(st.text())
def test_words_are_one_printable_line(text: str) -> None:
    found = words_of(text)
    assert len(found) <= 200
    assert found.isprintable()
