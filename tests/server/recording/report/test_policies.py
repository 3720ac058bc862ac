"""The section about policies, of a page of a session and of a dataset: its figures, and where it is not."""

import re
from pathlib import Path

import msgspec
import pyarrow.parquet as pq

from lockstep.server.cli.recordings.follow import append_once
from lockstep.server.recording.export import export_lerobot
from lockstep.server.recording.export.export_lerobot import DatasetOptions
from lockstep.server.recording.format.drivers import EventDriver
from lockstep.server.recording.format.records import FeedbackRecord, ShadowRecord
from lockstep.server.recording.report.dataset_page import dataset_page
from lockstep.server.recording.report.driver_figures import DriverTally
from lockstep.server.recording.report.page import session_page
from lockstep.server.recording.report.policies import policies_section
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from lockstep.server.recording.writing.writer import Entry
from tests.server.recording.episodes.test_edited_datasets import change
from tests.server.recording.makers import EPOCH, INTERVAL, START, Story, own_entry, rewritten
from tests.server.recording.report.test_page import checked
from tests.server.recording.test_episode_export import episode, recording

NET = EventDriver("net", "policy")
ADA = EventDriver("Ada", "human")
GRACE = EventDriver("<Grace>", "human", True)


def plain(html: str) -> str:
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", html))


def driven(path: Path) -> Path:
    """Episodes of 40 events, 1.6 s each: Ada's; the policy's, corrected twice; the policy's alone, which fails."""

    def by(number: int) -> EventDriver:
        corrects = 60 <= number < 65 or number in (70, 71)
        return ADA if number < 50 else GRACE if corrects else NET

    def change(entry: Entry) -> list[Entry]:
        record, driver = entry.record, by(entry.event)
        if isinstance(record, FeedbackRecord):
            named = msgspec.structs.replace(
                record, driver=driver.name, driver_kind=driver.kind, intervention=driver.intervention
            )
            return [own_entry(named, entry.arrived, entry.captured)]
        return [entry]

    records = [
        *(episode("a", "start", 2, 2), episode("a", "kept", 2, 42, outcome="success")),
        *(episode("b", "start", 50, 50), episode("b", "kept", 50, 90, outcome="success")),
        *(episode("c", "start", 100, 100), episode("c", "kept", 100, 140, outcome="failure")),
    ]
    shadow = ShadowRecord(
        epoch=EPOCH, event=20, peer="p", name="net", values=[0.0], judgement="in_time", difference=0.01,
        driver_kind="human",
    )  # fmt: skip
    entries = [*Story(events=150, real=True).entries(), *records, own_entry(shadow, START + 19 * INTERVAL)]
    return rewritten(path, sorted(entries, key=lambda each: each.arrived), change)


def test_a_session_tells_interventions_a_minute_success_by_driver_and_how_far_shadows_agree(tmp_path: Path) -> None:
    html = session_page(driven(tmp_path / "a.mcap"))
    checked(html)
    assert "<Grace>" not in html
    text = plain(html.replace("&lt;", "{").replace("&gt;", "}"))
    assert "2 interventions in 0.1 minutes of episodes in which a policy drove: 37.50 a minute." in text
    assert re.search(r"\{Grace\} human 7 0\.3 2 7 ", text)
    assert re.search(r"Ada 1 0 0 100 % .*policy net alone 0 1 0 0 % .*policy net corrected 1 0 0 100 %", text)
    assert re.search(r"net 1 in time 1 1 100 %", text)


def test_a_session_tells_outcomes_and_interventions_of_episodes_as_they_were_changed_since(tmp_path: Path) -> None:
    path = driven(tmp_path / "a.mcap")
    change(path, {"episode": "a", "outcome": "failure"})
    change(path, {"episode": "c", "dropped": True})
    change(path, {"episode": "b", "first_event": 50, "last_event": 68})
    text = plain(session_page(path))
    assert re.search(r"Ada 0 1 0 0 % .*policy net corrected 1 0 0 100 %", text)
    assert "policy net alone" not in text
    assert "1 interventions in 0.0 minutes of episodes in which a policy drove: 25.86 a minute." in text, "in 2.32 s"


def test_a_session_of_people_alone_has_no_such_section(tmp_path: Path) -> None:
    html = session_page(recording(tmp_path / "a.mcap", events=30))
    assert "Policies" not in html
    assert "Interventions" not in html
    assert policies_section(DriverTally()) == ""


def test_a_dataset_tells_the_same_of_its_rows_whether_it_was_exported_or_grew_in_batches(tmp_path: Path) -> None:
    path = driven(tmp_path / "a.mcap")
    (whole,) = export_lerobot.export(path, tmp_path / "whole", "")
    grown = tmp_path / "grown"
    append_once([path], grown, DatasetOptions(), print)
    assert len(list(grown.glob("data/*/*.parquet"))) == 3
    pages = [plain(dataset_page(root).replace("&lt;", "{").replace("&gt;", "}")) for root in (whole, grown)]
    assert pages[0].partition(" Tasks ")[2] == pages[1].partition(" Tasks ")[2] != ""
    text = pages[0]
    assert "2 interventions in 0.1 minutes of episodes in which a policy drove: 38.46 a minute." in text
    assert re.search(r"Ada human 40 1 0 1 0 100 %", text)
    assert re.search(r"net policy 73 2 0 1 1 50 %", text)
    assert re.search(r"\{Grace\} human 7 1 2 1 0 100 %", text)
    assert re.search(r"policy net alone 0 1 0 0 % policy net corrected 1 0 0 100 %", text)
    assert re.search(r"0 push success .*? 2 – 42 40 0 1\.6 ", text)


def test_a_page_of_a_grown_dataset_shows_the_pictures_of_the_rows_in_every_batch(tmp_path: Path) -> None:
    kept = [record for id, first in (("a", 10), ("b", 30), ("c", 50)) for record in (
        episode(id, "start", first, first), episode(id, "kept", first, first + 15)
    )]  # fmt: skip
    late = {15: 13, 16: 13, 36: 35, 55: 54}
    path = recording(tmp_path / "a.mcap", *kept, events=80, stamps=late)
    grown = tmp_path / "grown"
    append_once([path], grown, DatasetOptions(), print)
    found = checked(dataset_page(grown)).sources
    (whole,) = export_lerobot.export(path, tmp_path / "whole", "")
    assert len(found) == 3
    assert found == checked(dataset_page(whole)).sources


def test_the_check_looks_at_every_batch_of_a_grown_dataset(tmp_path: Path) -> None:
    path = driven(tmp_path / "a.mcap")
    append_once([path], tmp_path / "grown", DatasetOptions(), print)
    verdict = verify_dataset(tmp_path / "grown")
    assert (verdict.ok, verdict.rows, verdict.checks["aligned"].looked) == (True, 120, 120)
    table = tmp_path / "grown/data/chunk-000/file-002.parquet"
    rows = pq.read_table(table)
    stamps = [stamp + 5 for stamp in rows["lockstep.stamp"].to_pylist()]
    pq.write_table(rows.set_column(rows.schema.get_field_index("lockstep.stamp"), "lockstep.stamp", [stamps]), table)
    assert verify_dataset(tmp_path / "grown").checks["aligned"].count == 40
