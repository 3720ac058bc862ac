"""What a test leaves is set back for the next one; a new console is started only where that fails."""

import httpx

from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from tests.e2e.as_new import as_new
from tests.support.stack import Stack

TURN = [0.0, 0.0, 1.0]


async def test_a_robot_that_a_test_has_turned_drives_home(stack: Stack) -> None:
    async with Console(stack.operator, video=False, audio=False) as console:
        await console.take_seat()
        while console.feedback is None or abs(console.feedback.joints[2]) < 0.5:
            await drive_on(console, TURN)
    assert await as_new(stack)
    token = stack.supervisor.partition("#token=")[2]
    async with httpx.AsyncClient(
        base_url=stack.console, headers={"Authorization": f"Bearer {token}"}, trust_env=False
    ) as http:
        session = (await http.get("/api/session")).json()
    assert session["participants"] == []
    assert max(abs(joint) for joint in session["feedback"]["joints"]) < 0.1
