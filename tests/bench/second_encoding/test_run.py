"""The figures of an operator and an observer, and the whole in short."""

import pytest

from lockstep.bench.second_encoding import run as second_encoding
from lockstep.bench.second_encoding.person import Seen
from lockstep.bench.second_encoding.run import Client, run
from lockstep.emulator.errors import NamespacesUnavailable
from lockstep.emulator.namespace.tun import open_tun


def test_a_command_counts_until_the_first_picture_of_its_event_or_a_later_one() -> None:
    sent = [(2, 0.0), (3, 0.1), (4, 0.2), (5, 0.3)]
    shown = [(0.05, 1, 0, 640), (0.15, 2, 0, 640), (0.25, 4, 0, 640)]
    assert Client(sent, shown).command_to_picture() == pytest.approx([150.0, 150.0, 50.0])


def test_no_picture_from_before_a_command_counts_for_it() -> None:
    assert Client([(2, 1.0)], [(0.5, 2, 0, 640), (1.25, 2, 0, 640)]).command_to_picture() == pytest.approx([250.0])
    assert Client([], []).command_to_picture() == []


def test_a_drive_lasts_until_a_picture_and_the_answer_to_a_command_that_left_after_the_mark_came() -> None:
    seen = Seen(sent=[(2, 0.0), (3, 0.1)], shown=[(0.05, 1, 0, 640)])
    assert seen.has_seen(drives=True)
    seen.mark()
    assert not seen.has_seen(drives=False)
    seen.shown.append((0.2, 3, 0, 640))
    assert seen.has_seen(drives=False)
    seen.sent.append((4, 0.1))  # it may have left before the mark
    assert not seen.has_seen(drives=True)


@pytest.mark.timeout(120)
async def test_an_operator_and_an_observer_behind_three_routers_see_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    try:
        open_tun("10.0.1.2").close()
    except NamespacesUnavailable as reason:
        pytest.skip(str(reason))
    monkeypatch.setattr(second_encoding, "SETTLE", 0.0)
    found = await run(
        "perfect", "planar", 500_000.0, 0.0, seed=1, second=True
    )  # it lasts until both have seen something
    assert found["robot_kbit_s"] > 0
    assert found["operator_pictures_per_second"] > 0
    assert found["observer_pictures_per_second"] > 0
    assert found["events_per_second"] > 0
    assert found["largest_gap"] <= 4
