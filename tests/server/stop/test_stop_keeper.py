import asyncio
import hashlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from lockstep.protocol.messages import StopTaken
from lockstep.server.stop import stop_keeper
from lockstep.server.stop.stop_keeper import KEPT, KEPT_IN_MEMORY, StopKeeper
from lockstep.server.stop.stop_presses import Press
from lockstep.server.stop.stop_store import KeptStops, kept_stops_place
from tests.server.rig import PATIENCE

ROBOT = "tcp://127.0.0.1:1"


@asynccontextmanager
async def _running(directory: Path) -> AsyncIterator[StopKeeper]:
    keeper = StopKeeper(directory, ROBOT)
    await keeper.load()
    task = asyncio.create_task(keeper.run())
    try:
        yield keeper
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def _on_disk(directory: Path) -> int:
    return len(list(directory.rglob("*.json")))


def _pressed(keeper: StopKeeper, name: str) -> Press:
    press = Press(id=name, reason="smoke")
    keeper.presses.press(press)
    return press


async def test_a_stop_that_is_kept_is_on_the_disk_and_pending_in_the_next_run_until_it_is_answered(
    tmp_path: Path,
) -> None:
    async with _running(tmp_path) as keeper:
        keeper.keep(_pressed(keeper, "a"))
        assert await keeper.written("a") == ""
        assert _on_disk(tmp_path) == 1
    async with _running(tmp_path) as keeper:
        assert keeper.presses.pending == [Press(id="a", reason="smoke")]
        keeper.presses.taken(StopTaken(press="a", number=1))
        keeper.settled("a")
        async with asyncio.timeout(PATIENCE):
            while _on_disk(tmp_path):  # noqa: ASYNC110
                await asyncio.sleep(0.01)
    async with _running(tmp_path) as keeper:
        assert keeper.presses.pending == []


async def test_what_was_answered_meanwhile_is_not_kept(tmp_path: Path) -> None:
    async with _running(tmp_path) as keeper:
        press = _pressed(keeper, "a")
        keeper.presses.taken(StopTaken(press="a", number=1))
        keeper.keep(press)
        assert await keeper.written("a") == ""
        assert _on_disk(tmp_path) == 0


async def test_what_has_no_answer_when_the_console_ends_is_written_then(tmp_path: Path) -> None:
    async with _running(tmp_path) as keeper:
        await asyncio.sleep(0)
        _pressed(keeper, "a")
    assert _on_disk(tmp_path) == 1


async def test_a_disk_that_does_not_take_stops_is_told_of_and_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_keeper, "RETRY_SECONDS", 0.01)
    keep, fails = KeptStops.keep, True

    def fail(files: KeptStops, press: Press) -> None:
        if fails:
            raise OSError(28, "No space left on device")
        keep(files, press)

    monkeypatch.setattr(KeptStops, "keep", fail)
    async with _running(tmp_path) as keeper:
        waiting = asyncio.create_task(keeper.trouble_other_than(""))
        keeper.keep(_pressed(keeper, "a"))
        assert await keeper.written("a") == "No space left on device"
        async with asyncio.timeout(PATIENCE):
            assert await waiting == "No space left on device"
            fails = False
            assert await keeper.trouble_other_than("No space left on device") == ""
        assert await keeper.written("a") == ""
        assert _on_disk(tmp_path) == 1


async def test_a_disk_that_hangs_holds_up_nobody_who_pressed_for_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_keeper, "WRITE_PATIENCE", 0.01)
    keeper = StopKeeper(tmp_path, ROBOT)  # nobody runs it
    keeper.keep(_pressed(keeper, "a"))
    assert await keeper.written("a") == "the disk has not answered"


async def test_whoever_pressed_is_told_how_long_a_stop_is_kept(tmp_path: Path) -> None:
    async with _running(tmp_path) as keeper:
        for lasts, words in ((True, KEPT), (False, f"{KEPT_IN_MEMORY}; the state directory is temporary")):
            keeper.lasts = lasts
            press = _pressed(keeper, f"press {lasts}")
            keeper.keep(press)
            assert await keeper.kept_words(press.id) == words
            assert "until this console ends" in words or lasts


async def test_what_cannot_be_written_or_dropped_of_one_press_keeps_no_other_stop_from_the_disk_nor_on_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_keeper, "RETRY_SECONDS", 0.01)

    def file_of(press: str) -> Path:
        name = hashlib.sha256(press.encode()).hexdigest()[:32]
        return kept_stops_place(tmp_path, ROBOT) / f"{name}.json"

    (file_of("a") / "in it").mkdir(parents=True)  # a folder in its place
    keeper = StopKeeper(tmp_path, ROBOT)
    task = asyncio.create_task(keeper.run())
    keeper.keep(_pressed(keeper, "a"))
    keeper.keep(_pressed(keeper, "b"))
    async with asyncio.timeout(PATIENCE):
        while not file_of("b").exists() or keeper.trouble != "Is a directory":  # noqa: ASYNC110
            await asyncio.sleep(0.01)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    async with _running(tmp_path) as keeper:
        found = keeper.presses.pending
        assert len(found) == 2, "whatever is in the place of a stop is one"
        for press in found:
            keeper.presses.taken(StopTaken(press=press.id, number=1))
            keeper.settled(press.id)
        async with asyncio.timeout(PATIENCE):
            while file_of("b").exists() or not keeper.trouble:  # noqa: ASYNC110
                await asyncio.sleep(0.01)
