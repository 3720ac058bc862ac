"""When a status is due, and what is left out of it."""

from collections.abc import Sequence

import pytest

from lockstep.protocol.actions import (
    MAX_STATUS_BYTES,
    MAX_STATUS_ITEMS,
    StatusItem,
    StatusKind,
    fits_kind,
    status_item_bytes,
)
from lockstep.robot_bridge.actions.status_issuer import StatusIssuer
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot


class SayingRobot(PlanarRobot):
    def __init__(self, items: Sequence[StatusItem] = (), *, pressed: bool | None = None) -> None:
        super().__init__()
        self.items = items
        self.pressed = pressed

    def status(self) -> Sequence[StatusItem]:
        return self.items

    def hardware_stop(self) -> bool | None:
        return self.pressed


def item(value: bool | float | str, kind: StatusKind = "number", name: str = "n") -> StatusItem:
    return StatusItem(name=name, label="N", kind=kind, value=value)


def test_a_status_is_issued_twice_a_second_and_when_a_newcomer_asks() -> None:
    issuer = StatusIssuer(SayingRobot([item(1.0)]))
    times = [number * 0.1 for number in range(11)]
    assert sum(issuer.look(now, 1) is not None for now in times) == 3
    issuer.want_issue()
    assert issuer.look(1.01, 1) is not None


def test_a_hardware_stop_that_changes_is_told_at_once() -> None:
    robot = SayingRobot(pressed=False)
    issuer = StatusIssuer(robot)
    assert issuer.look(0.0, 1) is not None
    robot.pressed = True
    assert issuer.look(0.01, 1) is None, "but no faster than a connection takes it"
    status = issuer.look(0.06, 1)
    assert status is not None
    assert (status.items[0].kind, status.items[0].value, status.items[0].level) == ("hardware_stop", True, "error")


def test_a_robot_that_says_nothing_issues_nothing_and_one_that_falls_silent_says_so_once_more() -> None:
    robot = SayingRobot()
    issuer = StatusIssuer(robot)
    assert issuer.look(0.0, 1) is None
    robot.items = [item(1.0)]
    assert issuer.look(1.0, 1) is not None
    robot.items = []
    status = issuer.look(2.0, 1)
    assert status is not None
    assert status.items == []


def test_what_does_not_fit_or_is_named_twice_or_too_many_is_left_out() -> None:
    bad = [
        item(float("nan")),
        item("12"),
        item(True),
        item(1.5, "battery", "b"),
        item("x" * 501, "text", "t"),
        item(1e13, name="big"),
    ]
    many = [item(1.0, name=f"n{number}") for number in range(100)]
    status = StatusIssuer(SayingRobot([*bad, *many, many[0]])).look(0.0, 1)
    assert status is not None
    assert [each.name for each in status.items] == [f"n{number}" for number in range(MAX_STATUS_ITEMS)]


def test_items_that_together_no_peer_could_take_are_left_out_by_name(caplog: pytest.LogCaptureFixture) -> None:
    long = [
        StatusItem(name=f"{number}", label="\N{SNOWMAN}" * 200, kind="text", value="x" * 500, text="y" * 500)
        for number in range(MAX_STATUS_ITEMS)
    ]
    status = StatusIssuer(SayingRobot([*long, item(1.0, name="small")], pressed=False)).look(0.0, 1)
    assert status is not None
    names = [each.name for each in status.items]
    assert names[:2] == ["hardware_stop", "0"]
    assert names[-1] == "small", "what still fits is told"
    assert sum(map(status_item_bytes, status.items)) <= MAX_STATUS_BYTES
    assert "the status item '63' does not fit into the 49152 bytes of a status, and is left out" in caplog.text


def test_text_that_is_no_unicode_is_left_out() -> None:
    status = StatusIssuer(SayingRobot([item("\ud800", "text"), item(1.0, name="m")])).look(0.0, 1)
    assert status is not None
    assert [each.name for each in status.items] == ["m"]


@pytest.mark.parametrize(
    ("kind", "good", "wrong"),
    [
        ("battery", 0.5, 1.1),
        ("temperature", -3.0, True),
        ("hardware_stop", True, 1.0),
        ("switch", False, "off"),
        ("mode", "auto", 1.0),
        ("text", "", False),
    ],
)
def test_a_value_fits_its_kind(kind: StatusKind, good: bool | float | str, wrong: bool | float | str) -> None:
    assert fits_kind(item(good, kind))
    assert not fits_kind(item(wrong, kind))
