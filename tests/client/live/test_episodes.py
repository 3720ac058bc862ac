"""Episodes between a real console and real clients; the file on the disk is the judge."""

import asyncio
import json
import os
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import av
import httpx
import pyarrow.parquet as pq
import pytest

from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console, EpisodeRefused
from lockstep.client.console_url import parse_link
from lockstep.protocol.episodes import EpisodeState
from lockstep.robot_bridge.robots.event_strip import read_event_strip
from lockstep.server.recording.export import export_lerobot
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from lockstep.server.recording.verify.verify_file import verify_file
from tests.client.held_up import act_on, arm_on
from tests.support.stack import Stack, running_stack
from tests.waiting import PATIENCE

AWAY = [0.2, 0.0, 0.0]
NO_COUNTDOWN = {"LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": "0"}


def _console(link: str, name: str = "Ada") -> Console:
    return Console(link, video=False, audio=False, name=name)


async def _drive(console: Console, events: int = 5) -> None:
    for _ in range(events):
        await drive_on(console, AWAY)


@asynccontextmanager
async def _in_an_episode(
    directory: Path, recordings: Path, settings: dict[str, str] = NO_COUNTDOWN
) -> AsyncIterator[tuple[Stack, Console]]:
    """A recorded session, and its operator, who has begun an episode and drives."""
    async with (
        running_stack(directory, extra=("--record", str(recordings)), settings=settings) as stack,
        _console(stack.operator) as console,
    ):
        await console.take_seat()
        await console.episodes.start("push")
        await _drive(console)
        yield stack, console


async def _ask(stack: Stack, link: str, do: str, **body: str) -> httpx.Response:
    """`do`: "" asks for the state."""
    async with httpx.AsyncClient(trust_env=False) as http:
        headers = {"Authorization": f"Bearer {parse_link(link).token}"}
        if not do:
            return await http.get(f"{stack.console}/api/episode", headers=headers)
        return await http.post(f"{stack.console}/api/episode/{do}", json=body, headers=headers)


def _episodes(path: Path) -> list[EpisodeEntry]:
    with RecordingReader(path) as reader:
        return reader.index.episodes


async def _until_state(console: Console, found: str) -> EpisodeState:
    async with asyncio.timeout(PATIENCE):
        while console.episodes.state.phase != found:  # noqa: ASYNC110
            await asyncio.sleep(0.01)
    return console.episodes.state


@pytest.mark.asyncio
async def test_episodes_of_a_session_are_in_its_file_as_they_were_kept(tmp_path: Path) -> None:
    """Kept, discarded, redone; asked for by the holder of the seat on the channel, by a supervisor over HTTP."""
    recordings = tmp_path / "recordings"
    async with running_stack(tmp_path, extra=("--record", str(recordings)), settings=NO_COUNTDOWN) as stack:  # noqa: SIM117
        async with _console(stack.operator) as console, _console(stack.observer, "Grace") as observer:
            with pytest.raises(EpisodeRefused, match="not_allowed"):
                await console.episodes.start("push the box")  # nobody holds the seat
            await console.take_seat()
            with pytest.raises(EpisodeRefused, match="not_allowed"):
                await observer.episodes.start("push the box")
            with pytest.raises(EpisodeRefused, match="no_task"):
                await console.episodes.start()
            first = await console.episodes.start("push the box")
            with pytest.raises(EpisodeRefused, match="empty"):
                await console.episodes.keep()
            await _drive(console)
            await console.episodes.mark("touched")
            await console.episodes.success()
            assert console.episodes.state.kept == (await _until_state(observer, "idle")).kept == 1
            second = await console.episodes.start()
            await _drive(console)
            third = await console.episodes.redo(second)
            await _drive(console)
            with pytest.raises(EpisodeRefused, match="other_episode"):
                await console.episodes.keep("success", first)
            assert (await _ask(stack, stack.observer, "keep")).json()["error"] == "not_allowed"
            assert (await _ask(stack, stack.observer, "mark", text="no")).json()["error"] == "not_allowed"
            assert (await _ask(stack, stack.supervisor, "mark", text="wobbled")).status_code == 200
            kept = await _ask(stack, stack.supervisor, "keep", outcome="failure", episode=third)
            assert (kept.status_code, kept.json()["kept"], kept.json()["discarded"]) == (200, 2, 1)
            answer = await _ask(stack, stack.supervisor, "discard")
            assert (answer.status_code, answer.json()["error"]) == (409, "no_episode")
            await console.episodes.start()
            await _drive(console)
            again = await _ask(stack, stack.supervisor, "redo")
            assert (again.status_code, again.json()["phase"], again.json()["discarded"]) == (200, "open", 2)
            await _drive(console)
            await console.episodes.discard()
            asked = await _ask(stack, stack.observer, "")
            assert (asked.json()["phase"], asked.json()["kept"], asked.json()["discarded"]) == ("idle", 2, 3)
    (path,) = recordings.glob("*.mcap")
    found = _episodes(path)
    assert [(each.id, each.state, each.outcome) for each in found[:3]] == [
        (first, "kept", "success"),
        (second, "discarded", ""),
        (third, "kept", "failure"),
    ]
    assert [each.state for each in found[3:]] == ["discarded", "discarded"]
    assert [[text for _, text in each.marks] for each in found[:3]] == [["touched"], [], ["wobbled"]]
    assert found[0].drivers == ["Ada"]
    assert all(each.last_event > each.first_event for each in found)
    verdict = verify_file(path)
    assert verdict.ok, verdict


@pytest.mark.asyncio
async def test_without_a_recording_no_episode_begins_and_its_end_cuts_the_open_one(tmp_path: Path) -> None:
    async with running_stack(tmp_path, settings=NO_COUNTDOWN) as stack, _console(stack.operator) as console:
        await console.take_seat()
        with pytest.raises(EpisodeRefused, match="recording_off"):
            await console.episodes.start("push")
        headers = {"Authorization": f"Bearer {parse_link(stack.operator).token}"}
        async with httpx.AsyncClient(base_url=stack.console, headers=headers, trust_env=False) as http:
            begun = (await http.post("/api/recordings", json={})).json()
            episode = await console.episodes.start("push")
            await _drive(console)
            await http.post("/api/recordings/stop", json={})
            state = await _until_state(console, "idle")
            assert (state.cut, state.last) == (1, "episode 1 is lost: the recording ended")
            with pytest.raises(EpisodeRefused, match="no_episode"):
                await console.episodes.keep()
    (path,) = (tmp_path / "state" / "recordings").glob(f"{begun['recording']}*.mcap")
    assert [(each.id, each.state, each.why) for each in _episodes(path)] == [(episode, "cut", "recording_ended")]


@pytest.mark.asyncio
async def test_a_stop_in_an_episode_is_marked_and_does_not_end_it(tmp_path: Path) -> None:
    recordings = tmp_path / "recordings"
    async with _in_an_episode(tmp_path, recordings) as (_, console):
        await console.stop("a look")
        await console.reset()
        await arm_on(console)
        await _drive(console)
        await console.episodes.keep()
    (path,) = recordings.glob("*.mcap")
    (found,) = _episodes(path)
    assert found.state == "kept"
    assert any("a look" in text for _, text in found.marks)
    assert any("reset" in text for _, text in found.marks)


@pytest.mark.asyncio
async def test_a_robot_that_is_lost_or_restarted_cuts_the_episode(tmp_path: Path) -> None:
    recordings = tmp_path / "recordings"
    async with _in_an_episode(tmp_path, recordings) as (stack, console):
        os.kill(stack.bridge_pid(), signal.SIGKILL)
        state = await _until_state(console, "idle")
        assert "the robot link was lost" in state.last
    files = sorted(recordings.glob("*.mcap"))
    assert [(each.state, each.why) for path in files for each in _episodes(path)] == [("cut", "link_down")]


@pytest.mark.asyncio
@pytest.mark.parametrize("phase", ["countdown", "open", "kept", "discarded", "redone"])
async def test_a_console_that_is_killed_in_any_phase_leaves_no_more_than_what_was_kept(
    phase: str, tmp_path: Path
) -> None:
    """One episode is kept before; the rest of the file is whatever was on the disk when the process was killed."""
    recordings = tmp_path / "recordings"
    settings = {"LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": "0.2"}
    async with running_stack(tmp_path, extra=("--record", str(recordings)), settings=settings) as stack:  # noqa: SIM117
        async with _console(stack.operator) as console:
            await console.take_seat()
            expected = [await console.episodes.start("push")]
            await _drive(console)
            await console.episodes.keep()
            if phase == "countdown":
                starting = asyncio.ensure_future(console.episodes.start())
                await _until_state(console, "countdown")
            else:
                second = await console.episodes.start()
                await _drive(console)
                if phase == "kept":
                    await console.episodes.success()
                    expected.append(second)
                elif phase == "discarded":
                    await console.episodes.discard()
                elif phase == "redone":
                    await console.episodes.redo()
                    await _drive(console)
            stack.process.kill()
            await stack.process.wait()
            if phase == "countdown":
                starting.cancel()
    (path,) = recordings.glob("*.mcap")
    assert [each.id for each in _episodes(path) if each.state == "kept"] == expected


@pytest.mark.asyncio
async def test_every_row_of_a_dataset_shows_its_own_event_within_the_tolerance_on_all_cameras(tmp_path: Path) -> None:
    """The event that the robot drew into each picture is read from the dataset's own pixels."""
    recordings, tolerance = tmp_path / "recordings", 4
    async with running_stack(tmp_path, extra=("--record", str(recordings)), settings=NO_COUNTDOWN) as stack:  # noqa: SIM117
        async with Console(stack.operator, audio=False, codec="H264") as console:
            await console.take_seat()
            kept = []
            for outcome in ("success", "", "failure"):
                episode = await console.episodes.start("push the box")
                for number in range(30):
                    await drive_on(console, [0.2 if number % 2 else -0.2, 0.0, 0.0])
                if outcome:
                    await console.episodes.keep("success" if outcome == "success" else "failure")
                    kept.append(episode)
                else:
                    await console.episodes.discard()
    (path,) = recordings.glob("*.mcap")
    (root,) = export_lerobot.export_all([path], tmp_path / "dataset", "", tolerance)
    notes = json.loads((root / "meta" / "lockstep.json").read_text())
    assert [each["episode"] for each in notes["episodes"]] == kept
    discarded = next(each for each in _episodes(path) if each.state == "discarded")
    events = pq.read_table(root / "data/chunk-000/file-000.parquet").column("lockstep.event").to_pylist()
    assert not [event for event in events if discarded.first_event <= event < discarded.last_event]
    assert len(events) > 20
    assert len(notes["cameras"]) == 2
    for camera in notes["cameras"]:
        with av.open(str(root / "videos" / camera / "chunk-000/file-000.mp4")) as video:
            drawn = [read_event_strip(each.to_ndarray(format="gray")) for each in video.decode(video=0)]
        assert len(drawn) == len(events)
        gaps = [event - own for event, own in zip(events, drawn, strict=True) if own is not None]
        assert len(gaps) > 0.9 * len(events)
        assert min(gaps) >= 0
        assert max(gaps) <= tolerance
    assert verify_dataset(root).ok


@pytest.mark.asyncio
async def test_the_reset_action_runs_between_episodes_and_the_next_one_waits_for_it(tmp_path: Path) -> None:
    """`light` moves nothing, so the console asks for it; `home` moves the robot, so whoever drives has to."""
    recordings = tmp_path / "recordings"
    settings = NO_COUNTDOWN | {"LOCKSTEP_EPISODES__RESET_ACTION": "home"}
    async with _in_an_episode(tmp_path, recordings, settings) as (_, console):
        redone = asyncio.ensure_future(console.episodes.redo())
        state = await _until_state(console, "resetting")
        assert (state.reset_action, state.discarded) == ("home", 1)
        await console.rest()
        await arm_on(console)
        assert (await act_on(console, "home")).state == "done"
        async with asyncio.timeout(PATIENCE):
            assert await redone == console.episodes.state.episode
        await _drive(console)
        await console.episodes.keep()
    (path,) = recordings.glob("*.mcap")
    assert [each.state for each in _episodes(path)] == ["discarded", "kept"]


@pytest.mark.asyncio
async def test_a_revoked_link_begins_no_episode_that_it_asked_for_before(tmp_path: Path) -> None:
    recordings = tmp_path / "recordings"
    settings = {"LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": "4"}
    async with (
        running_stack(tmp_path, extra=("--record", str(recordings)), settings=settings) as stack,
        _console(stack.observer, "Grace") as observer,
    ):
        headers = {"Authorization": f"Bearer {parse_link(stack.supervisor).token}"}
        async with httpx.AsyncClient(base_url=stack.console, headers=headers, trust_env=False) as http:
            made = (await http.post("/api/invitations", json={"role": "supervisor", "name": "Eve"})).json()
            assert (await _ask(stack, made["link"], "start", task="push")).json()["phase"] == "countdown"
            await _until_state(observer, "countdown")
            assert (await http.delete(f"/api/invitations/{made['id']}")).is_success
        state = await _until_state(observer, "idle")
        assert (state.number, state.last) == (0, "cancelled before it began: the link that asked for it has ended")
    (path,) = recordings.glob("*.mcap")
    assert _episodes(path) == []


@pytest.mark.asyncio
async def test_a_reset_that_moves_nothing_is_run_by_the_console(tmp_path: Path) -> None:
    settings = NO_COUNTDOWN | {"LOCKSTEP_EPISODES__RESET_ACTION": "light"}
    async with _in_an_episode(tmp_path, tmp_path / "recordings", settings) as (_, console):
        await console.episodes.keep()
        await _until_state(console, "idle")
        assert "failed" not in console.episodes.state.last
        assert [(each.name, each.by, each.state) for each in console.actions] == [("light", "episodes", "done")]
        assert await console.episodes.start()
