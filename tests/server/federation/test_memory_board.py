import asyncio

from lockstep.server.audit.records import Actor, AuditRecord
from lockstep.server.federation.memory_board import MemoryBoard
from lockstep.server.stop.stop_presses import new_press
from tests.server.federation.boards import tile


async def test_a_console_that_is_alone_has_no_others_and_misses_nothing() -> None:
    board = MemoryBoard()
    running = asyncio.get_running_loop().create_task(board.run())
    board.publish([tile()])
    board.record("left", AuditRecord(n=1, time=0.0, kind="start"))
    assert board.others() == []
    assert (board.state.shared, board.state.unknown_since, board.state.conflicts) == (False, None, ())
    assert (await board.audit(10)) == ([], True, "")
    assert not (await board.stop(["far"], new_press(Actor(), "http", "")))["far"].confirmed
    running.cancel()
