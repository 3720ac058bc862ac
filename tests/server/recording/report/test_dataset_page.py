"""The page of a dataset: rates, delays and refused commands by episode, driver and camera."""

import json
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.export import export_lerobot
from lockstep.server.recording.export.export_lerobot import DatasetOptions, export_all
from lockstep.server.recording.format.topics import CAMERA
from lockstep.server.recording.report.dataset_page import dataset_page
from tests.server.recording.export.test_episode_commands import driven, refusal
from tests.server.recording.makers import Story, rewritten
from tests.server.recording.report.test_page import checked
from tests.server.recording.test_episode_export import episode


def plain(html: str) -> str:
    checked(html)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", html))


def recorded(path: Path) -> Path:
    return driven(path, refusal(12), refusal(13), refusal(18, "net", "jump"), refusal(14, "<Bo>", "no_seat"))


def test_a_page_tells_rates_delays_and_refused_commands_by_driver_and_episode(tmp_path: Path) -> None:
    (root,) = export_lerobot.export(recorded(tmp_path / "a.mcap"), tmp_path / "dataset", "")
    html = dataset_page(root)
    assert "<Bo>" not in html
    text = plain(html)
    assert "Ada human 5 1 0 1 0 100 % 25.0 10.0 10.0 late 2 " in text
    assert "net policy 5 1 0 1 0 100 % 25.0 31.0 31.0 jump 1 " in text
    assert "&lt;Bo&gt; none 0 0 – 0 0 – – – – no_seat 1 " in text
    assert "10 – 20 10 0 0.4 25.0 31.0 31.0 jump 1, late 2, no_seat 1 " in text
    assert "are known of" not in text


def test_a_dataset_from_before_does_not_know_delays_and_refusals_and_says_no_zero(tmp_path: Path) -> None:
    (root,) = export_lerobot.export(recorded(tmp_path / "a.mcap"), tmp_path / "dataset", "")
    notes = json.loads((root / "meta/lockstep.json").read_text())
    for each in notes["episodes"]:
        del each["commands"]
    (root / "meta/lockstep.json").write_text(json.dumps(notes))
    text = plain(dataset_page(root))
    assert "Delays and refused commands are known of 0 of 1 episodes." in text
    assert "Ada human 5 1 0 1 0 100 % 25.0 – – – " in text
    assert "10 – 20 10 0 0.4 25.0 – – – " in text


def test_a_camera_that_is_slower_than_the_events_has_its_own_rate(tmp_path: Path) -> None:
    bounds = [episode("a", "start", 1, 1), episode("a", "kept", 1, 41)]
    story = [
        each for each in Story(events=60, real=True).entries()
        if not each.topic.startswith(CAMERA) or each.event % 2 == 0
    ]  # fmt: skip
    path = rewritten(tmp_path / "a.mcap", sorted([*story, *bounds], key=lambda each: each.arrived), lambda each: [each])
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    text = plain(dataset_page(root))
    assert "Ada human 39 1 0 0 0 – 25.0 10.0 10.0 0 " in text
    assert "observation.images.front 39 51 % 1 19 12.5 " in text


def test_events_that_are_in_no_row_of_a_dataset_with_a_rate_count_all_the_same(tmp_path: Path) -> None:
    path = driven(tmp_path / "a.mcap", kept=(("a", 2, 15),))
    (root,) = export_all([path], tmp_path / "dataset", DatasetOptions(fps=5))
    assert "Ada human 4 1 0 1 0 100 % 25.0 10.0 10.0 0 " in plain(dataset_page(root))


def test_a_kept_episode_without_a_row_tells_its_refused_commands(tmp_path: Path) -> None:
    path = driven(tmp_path / "a.mcap", refusal(2), kept=(("a", 1, 2), ("b", 10, 20)))
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    assert re.search(
        r"without a row .* a push success 20270115-planar-ab12 part 1 1 late 1 ", plain(dataset_page(root))
    )


def numbers_in(value: Any, where: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield where a number is, or a key of an object that is one."""
    if isinstance(value, dict | list):
        for key, each in value.items() if isinstance(value, dict) else enumerate(value):
            yield from numbers_in(each, (*where, key))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield where


@pytest.mark.parametrize(
    "hostile", [-1, 0, 10**6, 2**53, 2**70, 10**400, -1e308, 0.5], ids=lambda number: str(number)[:20]
)
def test_no_number_in_the_notes_of_a_dataset_ends_its_page_in_a_traceback(tmp_path: Path, hostile: float) -> None:
    (root,) = export_lerobot.export(recorded(tmp_path / "a.mcap"), tmp_path / "dataset", "")
    file = root / "meta/lockstep.json"
    kept = file.read_text()
    places = list(numbers_in(json.loads(kept)))
    assert {"delays", "refused", "rows", "first_event"} <= {key for where in places for key in where}
    for where in places:
        notes = json.loads(kept)
        within = notes
        for key in where[:-1]:
            within = within[key]
        within[where[-1]] = hostile
        file.write_text(json.dumps(notes))
        with suppress(RecordingDamaged, OSError):  # which the command line says in one line
            checked(dataset_page(root))


def test_no_delay_in_the_notes_of_a_dataset_ends_its_page_in_a_traceback(tmp_path: Path) -> None:
    (root,) = export_lerobot.export(recorded(tmp_path / "a.mcap"), tmp_path / "dataset", "")
    file = root / "meta/lockstep.json"
    notes = json.loads(file.read_text())
    for hostile in ("-1.0", "1e308", "1e400", "NaN", "-Infinity", "", "late"):
        notes["episodes"][0]["commands"]["drivers"][0]["delays"] = {hostile: 1, "10.0": 2**53 - 1}
        file.write_text(json.dumps(notes))
        with suppress(RecordingDamaged):
            checked(dataset_page(root))
