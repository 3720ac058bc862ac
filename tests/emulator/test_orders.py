import json

import pytest

from lockstep.emulator.network_statistics import NetworkStatistics
from lockstep.emulator.orders import carry_out


class Told:
    """A network that writes down what it is told."""

    def __init__(self) -> None:
        self.orders: list[tuple[object, ...]] = []

    def outage(self, seconds: float, *, hold: bool = False, robot: bool = False) -> None:
        self.orders.append(("outage", seconds, hold, robot))

    def cut_robot(self) -> None:
        self.orders.append(("cut",))

    def statistics(self) -> NetworkStatistics:
        return NetworkStatistics(clients=3)


@pytest.mark.parametrize(
    ("order", "told"),
    [
        ("outage 5", ("outage", 5.0, False, False)),
        ("  hold 0.5 ", ("outage", 0.5, True, False)),
        ("robot outage 2", ("outage", 2.0, False, True)),
        ("robot hold 2", ("outage", 2.0, True, True)),
        ("cut", ("cut",)),
    ],
)
def test_an_order_is_carried_out(order: str, told: tuple[object, ...]) -> None:
    network = Told()
    assert carry_out(order, network) == ""
    assert network.orders == [told]


def test_statistics_are_answered_and_an_empty_line_is_not() -> None:
    assert json.loads(carry_out("statistics", Told()))["clients"] == 3
    assert carry_out("", Told()) == ""


@pytest.mark.parametrize(
    "order", ["outage", "outage -1", "outage inf", "outage nan", "moon outage 3", "stop", "outage 1 2"]
)
def test_what_is_no_order_is_told_which_there_are(order: str) -> None:
    network = Told()
    assert "outage SECONDS" in json.loads(carry_out(order, network))["error"]
    assert network.orders == []
