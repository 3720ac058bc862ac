"""The place of a robot that dials in, with lines that are only noted."""

import asyncio
import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from lockstep.protocol.dial_in import PairingHello, PairingSecret, RobotToken
from lockstep.protocol.link_secret import LinkSecret
from lockstep.server.robot.dial_in import UNPAIRED, WAITING, DialIn
from lockstep.server.robot.paired_robot import FILE, PairedRobot, save_paired
from lockstep.server.robot.pairing_offer import Exchange, Paired, Refusal
from lockstep.server.util.state_dir import StateDir, StateDirUnusable


class Line:
    def __init__(self, address: str = "192.0.2.7") -> None:
        self.address = address
        self.is_closed = False

    def carry(self, link: asyncio.Protocol) -> None:
        raise AssertionError("no link is made here")

    def close(self) -> None:
        self.is_closed = True


def place(directory: Path, given: LinkSecret | None = None) -> DialIn:
    return DialIn(StateDir(directory), given, lambda: None)


def paired(directory: Path) -> PairedRobot:
    robot = PairedRobot(LinkSecret.draw(), "planar", "Ann", 5.0)
    save_paired(StateDir(directory), robot)
    return robot


async def exchanged(dial_in: DialIn) -> tuple[Exchange, bytes]:
    """A robot that knows the code, up to its proof."""
    code = await dial_in.open_code("Ann")
    begun = dial_in.offer.begin(PairingHello(place=code.place, nonce=b"r" * 32, pin="trusted", robot="planar"), 0.0)
    assert not isinstance(begun, Refusal)
    exchange, challenge = begun
    secret = PairingSecret(code, challenge.salt)
    return exchange, secret.robot_proof(b"r" * 32, challenge.nonce, "trusted")


def test_before_a_robot_is_paired_no_token_fits(tmp_path: Path) -> None:
    dial_in = place(tmp_path)
    assert (dial_in.key, dial_in.words) == (None, UNPAIRED)
    for header in ("", RobotToken.of(LinkSecret.draw()).header):
        assert not dial_in.knows(header)


def test_a_robot_that_was_paired_before_is_known_by_its_token_alone(tmp_path: Path) -> None:
    robot = paired(tmp_path)
    dial_in = place(tmp_path)
    assert dial_in.words == WAITING
    assert dial_in.knows(RobotToken.of(robot.key).header)
    assert not dial_in.knows(RobotToken.of(LinkSecret.draw()).header)


@pytest.mark.parametrize("content", [b"", b"{", b'{"key": "short"}', b'{"key": 7}'])
def test_a_damaged_file_lets_no_robot_in_and_says_so(tmp_path: Path, content: bytes) -> None:
    (tmp_path / FILE).write_bytes(content)
    dial_in = place(tmp_path)
    assert dial_in.key is None
    assert FILE in dial_in.words


async def test_a_damaged_file_can_be_forgotten(tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(b"{")
    dial_in = place(tmp_path)
    await dial_in.forget()
    assert dial_in.words == place(tmp_path).words == UNPAIRED


async def test_a_robot_is_on_the_disk_for_its_owner_alone_before_it_is_answered(tmp_path: Path) -> None:
    dial_in = place(tmp_path)
    outcome = await dial_in.prove(*await exchanged(dial_in))
    assert isinstance(outcome, Paired)
    again = place(tmp_path)
    assert again.paired is not None
    assert (again.paired.robot, again.paired.by) == ("planar", "Ann")
    assert again.paired.key.reveal() == outcome.key.reveal()
    assert (tmp_path / FILE).stat().st_mode & 0o777 == 0o600


async def test_a_robot_that_the_disk_does_not_take_is_not_paired(tmp_path: Path) -> None:
    dial_in = place(tmp_path)
    exchange = await exchanged(dial_in)
    (tmp_path / FILE).mkdir()  # nothing replaces a directory by a file
    with pytest.raises(StateDirUnusable):
        await dial_in.prove(*exchange)
    assert dial_in.key is None


async def test_the_newest_line_that_waits_is_taken_and_the_one_before_it_closed(tmp_path: Path) -> None:
    dial_in, first, second = place(tmp_path), Line(), Line()
    dial_in.arrived("operator", first)
    dial_in.arrived("operator", second)
    assert first.is_closed
    assert await dial_in.next_line("operator") is second
    assert dial_in.address == "192.0.2.7"


async def test_a_line_that_is_gone_again_is_not_taken(tmp_path: Path) -> None:
    dial_in, gone, there = place(tmp_path), Line(), Line()
    gone.close()
    dial_in.arrived("media", gone)
    waiting = asyncio.ensure_future(dial_in.next_line("media"))
    await asyncio.sleep(0)
    dial_in.arrived("media", there)
    assert await waiting is there


async def test_a_second_robot_that_waits_is_logged_once_until_another_connection_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[dict[str, str]] = []
    monkeypatch.setattr(
        "lockstep.server.robot.dial_in.log", SimpleNamespace(warning=lambda text, **more: said.append(more))
    )
    now = [0.0]
    dial_in = DialIn(StateDir(tmp_path), None, lambda: None, lambda: now[0])
    first, second = Line(), Line("192.0.2.8")
    dial_in.arrived("operator", first)
    assert not dial_in.is_taken("operator")
    await dial_in.next_line("operator")
    assert (dial_in.is_taken("operator"), dial_in.is_taken("media"), said) == (True, False, [])
    for line in (*(Line("192.0.2.8") for _ in range(20)), second):  # it dials again, since no console says hello
        dial_in.arrived("operator", line)
        now[0] += 2.5
    assert said == [{"waits": "192.0.2.8", "connected": "192.0.2.7"}]
    first.close()
    assert not dial_in.is_taken("operator")
    assert await dial_in.next_line("operator") is second
    for _ in range(20):
        dial_in.arrived("operator", Line())
        now[0] += 2.5
    assert said[1:] == [{"waits": "192.0.2.7", "connected": "192.0.2.8"}]


async def test_to_forget_a_robot_closes_its_lines_and_ends_its_token(tmp_path: Path) -> None:
    robot = paired(tmp_path)
    dial_in, carrying, waiting = place(tmp_path), Line(), Line()
    dial_in.arrived("operator", carrying)
    await dial_in.next_line("operator")
    dial_in.arrived("media", waiting)
    await dial_in.forget()
    assert carrying.is_closed
    assert waiting.is_closed
    assert not dial_in.knows(RobotToken.of(robot.key).header)
    assert place(tmp_path).key is None


async def test_a_robot_is_out_although_the_disk_does_not_take_it(tmp_path: Path) -> None:
    robot = paired(tmp_path)
    dial_in = place(tmp_path)
    os.unlink(tmp_path / FILE)
    (tmp_path / FILE).mkdir()
    with pytest.raises(StateDirUnusable):
        await dial_in.forget()
    assert not dial_in.knows(RobotToken.of(robot.key).header)


def test_a_key_of_the_settings_goes_before_what_was_paired(tmp_path: Path) -> None:
    robot, given = paired(tmp_path), LinkSecret.draw()
    dial_in = place(tmp_path, given)
    assert dial_in.key is given
    assert not dial_in.knows(RobotToken.of(robot.key).header)
