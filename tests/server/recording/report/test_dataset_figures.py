"""Rates by the rows of a dataset, and commands by its notes."""

from typing import Any

import pytest

from lockstep.server.recording.export.episode_commands import DriverCommands, EpisodeCommands
from lockstep.server.recording.export.lerobot_meta import DatasetEpisode
from lockstep.server.recording.report.dataset_figures import (
    Rate,
    Row,
    commands_by_driver,
    driver_of,
    event_rates,
    picture_rate,
)


def rows(*each: tuple[int, int, float, str], stamps: tuple[int, ...] = ()) -> list[Row]:
    """Of episode, event, time and driver."""
    return [
        {
            "episode_index": index,
            "lockstep.event": event,
            "lockstep.time": time,
            "lockstep.driver": name,
            "lockstep.driver_kind": "human",
            "stamp": stamps[at] if stamps else event,
        }
        for at, (index, event, time, name) in enumerate(each)
    ]


def rate(found: Rate) -> tuple[int, float]:
    return found.count, round(found.seconds, 9)


def test_events_are_those_that_each_row_s_command_began_in_the_time_to_the_next_row() -> None:
    found = event_rates(rows((0, 1, 0.0, "Ada"), (0, 2, 0.1, "Bo"), (0, 5, 0.4, "Bo"), (1, 50, 0.0, "Ada")), driver_of)
    assert set(found) == {("Ada", "human"), ("Bo", "human")}
    assert rate(found["Ada", "human"]) == (1, 0.1)
    assert rate(found["Bo", "human"]) == (3, 0.3)
    assert found["Bo", "human"].hertz == pytest.approx(10)


def test_a_pause_counts_two_seconds_and_an_event_in_several_rows_counts_once() -> None:
    pause = rows((0, 1, 0.0, "Ada"), (0, 2, 60.0, "Ada"), (0, 2, 60.0, "Ada"), (0, 3, 61.0, "Ada"))
    assert rate(event_rates(pause, driver_of)["Ada", "human"]) == (2, 3.0)


def test_one_row_has_no_rate() -> None:
    assert event_rates(rows((0, 1, 0.0, "Ada")), driver_of) == {}
    assert picture_rate(rows((0, 1, 0.0, "Ada")), lambda row: 1).hertz is None


def test_new_pictures_are_those_with_another_stamp_than_the_row_before_of_the_same_episode() -> None:
    shown = rows(
        *((0, event, event / 10, "Ada") for event in range(1, 6)), (1, 9, 0.0, "Ada"), (1, 10, 0.1, "Ada"),
        stamps=(1, 1, 3, 3, 5, 9, 9),
    )  # fmt: skip
    assert rate(picture_rate(shown, lambda row: int(row["stamp"]))) == (2, 0.5)


def episode(commands: EpisodeCommands | None) -> DatasetEpisode:
    return DatasetEpisode(
        recording="r", part=1, epoch="e", episode="a", first_event=1, last_event=9, task="push", outcome="", rows=8,
        left_out=0, commands=commands,
    )  # fmt: skip


def test_commands_are_added_up_over_the_episodes_of_which_they_are_known() -> None:
    one = DriverCommands(name="Ada", kind="human", delays={10.0: 8}, refused={"late": 2})
    other = DriverCommands(name="Ada", kind="human", delays={30.0: 2, 10.0: 1}, refused={"late": 1, "jump": 1})
    episodes = [episode(EpisodeCommands(drivers=[one])), episode(EpisodeCommands(drivers=[other])), episode(None)]
    driven: list[Any] = [(0, ("Ada", "human")), (1, ("Bo", "human")), (2, ("Cy", "human"))]
    found = commands_by_driver(episodes, driven)
    ada = found["Ada", "human"]
    assert (ada.delay(0.5), ada.delay(0.95)) == (10.0, 30.0)
    assert ada.refused == {"late": 3, "jump": 1}
    assert (found["Bo", "human"].refused, found["Bo", "human"].delay(0.5)) == ({}, None), "of nothing that he had, none"
    assert ("Cy", "human") not in found, "not known"
