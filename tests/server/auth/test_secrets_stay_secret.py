"""Tokens, tickets, credentials and secrets are in no log line, no referrer and no answer that they are not for."""

from pathlib import Path

import httpx

from lockstep.client import Console
from tests.support.stack import running_stack

TURN_SECRET = "a secret that only coturn knows too"


async def test_a_session_with_every_kind_of_trouble_writes_no_secret_into_its_log(tmp_path: Path) -> None:
    extra = ("--turn", "turn:127.0.0.1:9", "--turn-secret", TURN_SECRET)
    async with running_stack(tmp_path, extra=extra) as stack:
        tokens = [link.partition("#token=")[2] for link in (stack.operator, stack.observer)]
        headers = {"Authorization": f"Bearer {tokens[1]}"}
        async with httpx.AsyncClient(base_url=stack.console, trust_env=False, headers=headers) as http:
            scene = (await http.post("/api/scene")).json()["path"]
            ticket = scene.partition("/scene/ws/")[2].partition("&")[0]
            ice = (await http.get("/api/ice")).json()["ice_servers"][0]
            offered = [
                await http.post("/whep", content="v=0\r\n", headers={"Content-Type": "application/sdp"}),
                await http.post("/api/stop", content="{"),
                await http.get(f"/?token={tokens[1]}"),
                await http.get(f"/nothing/{tokens[0]}", headers={"Authorization": f"Bearer {tokens[0]}x"}),
                await http.get(f"/scene/ws/{ticket}"),
                await http.post("/api/reset"),
            ]
            for answer in offered:
                assert answer.headers["referrer-policy"] == "no-referrer"
                assert not any(token in answer.text for token in tokens)
            session = await http.get("/api/session")
            metrics = await http.get("/metrics")
        async with Console(stack.operator, video=False, audio=False) as console:
            await console.take_seat()
    log = "\n".join(stack.output)
    assert "peer joined" in log, "the log was read"
    secrets = {*tokens, ticket, ice["credential"], TURN_SECRET}
    assert len(secrets) == 5
    for secret in secrets:
        for where in (log, session.text, metrics.text):
            assert secret not in where
