"""The console reaches a bridge that does not take everybody."""

import asyncio
from pathlib import Path

import pytest
from pydantic import SecretStr, ValidationError

from lockstep.protocol.errors import LinkRefused
from lockstep.protocol.link_secret import LinkSecret
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.link.link_tls import LinkTls
from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.server.robot.bridge_process import BridgeProcess
from lockstep.server.robot.credentials import link_access
from lockstep.server.settings import Settings
from tests.server.rig import PATIENCE, eventually, running_console
from tests.support.certificates import Authority

SECRET = LinkSecret.draw()


async def test_the_console_drives_a_bridge_with_a_secret_and_client_certificates(tmp_path: Path) -> None:
    authority = Authority(tmp_path)
    tls = LinkTls(certificate=authority.issue("bridge"), authority=authority.certificate)
    settings = BridgeSettings(port=0, secret=SECRET, tls=tls)
    async with Bridge(create_robot("planar"), settings) as bridge:
        port = bridge.address[1]
        async with running_console(
            port,
            robot=f"tls://127.0.0.1:{port}",
            link_secret=SECRET.reveal(),
            link_tls_ca=authority.certificate,
            link_tls_cert=authority.issue("console"),
        ) as rig:
            async with asyncio.timeout(PATIENCE):
                await rig.dependencies.console.robot.reached.wait()
            assert bridge.links == 2  # commands and media


@pytest.mark.parametrize("secret", ["", "another secret, which is long enough too"])
async def test_a_console_with_a_wrong_secret_says_so(secret: str) -> None:
    async with (
        Bridge(create_robot("planar"), BridgeSettings(port=0, secret=SECRET)) as bridge,
        running_console(bridge.address[1], link_secret=secret) as rig,
    ):
        robot = rig.dependencies.console.robot
        await eventually(lambda: "unauthorised" in robot.detail)
        assert not robot.up


async def test_the_bridge_of_lockstep_up_takes_nobody_who_does_not_know_its_secret() -> None:
    process = BridgeProcess("planar", "127.0.0.1", 0, [], SECRET.reveal(), lambda _: None)
    try:
        port = int((await process.start()).rpartition(":")[2])
        async with RobotLink("127.0.0.1", port, "operator", secret=SECRET) as link:
            assert link.connected
        with pytest.raises(LinkRefused, match="unauthorised"):
            await RobotLink("127.0.0.1", port, "events").connect()
    finally:
        await process.close()


def test_a_secret_comes_from_the_file_first(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text(SECRET.reveal())
    settings = Settings(link_secret=SecretStr("x" * 40), link_secret_file=tmp_path / "secret")
    secret, tls = link_access(settings)
    assert secret is not None
    assert secret.reveal() == SECRET.reveal()
    assert tls is None
    assert link_access(Settings()) == (None, None)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"link_secret": "too short"}, "at least 32 bytes"),
        ({"link_secret_file": "/nowhere/secret"}, "cannot read"),
        ({"robot": "tls://robot:5600", "link_tls_ca": "/nowhere/ca.pem"}, "cannot use the TLS files"),
        ({"robot": "udp://robot:5600"}, "is not tcp://host:port, tls://host:port or dial-in"),
    ],
)
def test_what_is_no_good_is_said_at_the_start(given: dict[str, str], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Settings(**given)  # type: ignore[arg-type]
