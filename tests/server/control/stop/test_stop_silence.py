"""Stops of a link that a supervisor has silenced."""

import time
from typing import cast

import pytest

from lockstep.protocol.console import Notice
from lockstep.protocol.messages import Stop
from lockstep.server.auth.silenced_links import SILENCE_SECONDS
from lockstep.server.errors import (
    Silenced,
)
from lockstep.server.peers.peer import Peer
from tests.server.control.stop.stop_bench import StopBench


async def test_a_supervisor_silences_a_link_that_keeps_pressing_and_what_it_stopped_stays_stopped(
    bench: StopBench,
) -> None:
    sue, olga = bench.peers.all["sue"], bench.peers.all["olga"]
    bench.press("olga", "p")
    assert bench.silence.silence(cast(Peer, sue), olga.id, silent=True) is None
    assert bench.silence.holds(olga.identity.token_id)
    assert any("silenced" in each.text for each in bench.heard("olga", Notice))
    with pytest.raises(Silenced):
        bench.press("olga", "q")
    assert [cast(Stop, each).press for each in bench.robot.sent] == ["p"]
    bench.take("p", 1)
    bench.press("ann", "a")
    assert bench.silence.silence(cast(Peer, sue), olga.id, silent=False) is None
    assert not bench.silence.holds(olga.identity.token_id)
    bench.press("olga", "r")
    assert [each.what for each in bench.records("silence")] == ["silenced", "heard again"]
    assert ("olga", "silenced") in {(each.who, each.what) for each in bench.records("refusal")}


@pytest.mark.parametrize(("who", "whom"), [("ann", "olga"), ("olga", "ann"), ("sue", "sue"), ("sue", "nobody")])
async def test_only_supervisors_silence_and_nobody_silences_them(bench: StopBench, who: str, whom: str) -> None:
    by = cast(Peer, bench.peers.all[who])
    assert bench.silence.silence(by, f"{whom}-1", silent=True) == "not_allowed"
    bench.press("olga", "p")


async def test_a_silence_ends_by_itself_and_the_person_is_told(
    bench: StopBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    olga = bench.peers.all["olga"]
    bench.silence.silence(cast(Peer, bench.peers.all["sue"]), olga.id, silent=True)
    assert olga.silenced
    bench.silence.show()
    assert [each.level for each in bench.heard("olga", Notice)] == ["warning"], "said once"
    later = time.monotonic() + SILENCE_SECONDS
    monkeypatch.setattr(time, "monotonic", lambda: later)
    bench.silence.show()
    assert [each.level for each in bench.heard("olga", Notice)] == ["warning", "info"]
    bench.press("olga", "p")
