"""Whole processes behind an emulated network, where root and a TUN device allow it."""

import asyncio
import json
import os
import sys
from pathlib import Path

import pytest

from lockstep.emulator.errors import NamespacesUnavailable
from lockstep.emulator.impairment.delay import Constant
from lockstep.emulator.impairment.impairment import Impairment
from lockstep.emulator.impairment.profile import Profile, even_profile
from lockstep.emulator.namespace.namespaces import OPERATOR_ADDRESS, ROBOT_ADDRESS, Namespaces
from lockstep.emulator.namespace.tun import open_tun

SLOW = even_profile("slow", Impairment(delay=Constant(0.02)))
PIPE = asyncio.subprocess.PIPE
LOCKSTEP = str(Path(sys.executable).with_name("lockstep"))

DRIVE = """
import asyncio, json, sys
from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console

async def main():
    async with Console(sys.argv[1], tolerance=4, audio=False, connect_seconds=20) as console:
        await console.take_seat()
        for _ in range(5):
            feedback = await drive_on(console, [0.0, 0.0, 0.3])
        async for picture in console.pictures():
            break
        violations = sum(each.violations for each in console.stats().streams)
        print(json.dumps({"event": feedback.event, "violations": violations}))

asyncio.run(main())
"""

ECHO = """
import socket, sys
here = socket.create_server((sys.argv[1], 7000))
print("ready", flush=True)
connection, peer = here.accept()
print(peer[0], flush=True)
connection.sendall(connection.recv(100))
"""

ASK = """
import socket, sys, time
began = time.monotonic()
connection = socket.create_connection((sys.argv[1], 7000), 10)
connection.sendall(b"hello")
print(connection.recv(100).decode(), time.monotonic() - began)
"""


@pytest.fixture(autouse=True)
def _available() -> None:
    try:
        open_tun(ROBOT_ADDRESS).close()
    except NamespacesUnavailable as reason:
        pytest.skip(str(reason))


async def line(process: asyncio.subprocess.Process) -> str:
    assert process.stdout is not None
    async with asyncio.timeout(40):
        return (await process.stdout.readline()).decode().strip()


def python(script: str, *arguments: str) -> list[str]:
    return [sys.executable, "-c", script, *arguments]


async def test_processes_meet_only_through_the_emulated_network() -> None:
    async with Namespaces(SLOW) as spaces:
        echo = await spaces.start("robot", python(ECHO, ROBOT_ADDRESS), stdout=PIPE)
        assert await line(echo) == "ready"
        asking = await spaces.start("operator", python(ASK, ROBOT_ADDRESS), stdout=PIPE)
        word, seconds = (await line(asking)).split()
        assert await line(echo) == OPERATOR_ADDRESS
        assert word == "hello"
        assert float(seconds) >= 0.08, "the handshake's round trip, and the data's"
        assert spaces.statistics().paths["signalling"]["to_robot"].passed >= 3


async def test_leaving_ends_the_processes_and_what_they_started() -> None:
    async with Namespaces(SLOW) as spaces:
        shell = await spaces.start("operator", ["sh", "-c", "sleep 1000 & echo $!; wait"], stdout=PIPE)
        child = int(await line(shell))
        assert _network(str(child)) != _network("self")
    assert shell.returncode is not None
    assert not _runs(child)


def _network(process: str) -> Path:
    return Path(f"/proc/{process}/ns/net").readlink()


def _runs(pid: int) -> bool:
    """A zombie that nobody has waited for yet does not run."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


async def test_a_command_that_does_not_exist_says_so() -> None:
    async with Namespaces(SLOW) as spaces:
        process = await spaces.start("operator", ["/no/such/command"], stderr=PIPE)
        _, said = await process.communicate()
        assert b"/no/such/command: No such file" in said


async def test_a_console_and_a_client_run_unmodified_on_the_two_sides(tmp_path: Path) -> None:
    environment = os.environ | {"LOCKSTEP_STATE_DIR": str(tmp_path)}
    async with Namespaces("bursty-loss", seed=1) as spaces:
        up = [
            "up",
            "--json",
            "--robot",
            "planar",
            "--host",
            ROBOT_ADDRESS,
            "--port",
            "8000",
            "--robot-port",
            "0",
            "--quiet",
        ]
        console = await spaces.start("robot", [LOCKSTEP, *up], stdout=PIPE, env=environment)
        links = json.loads(await line(console))
        client = await spaces.start("operator", python(DRIVE, links["operator"]), stdout=PIPE)
        result = json.loads(await line(client))
        counts = spaces.statistics()
    assert result["event"] >= 5
    assert result["violations"] == 0
    assert counts.paths["media"]["to_operator"].mean_delay == pytest.approx(0.05)
    assert counts.paths["control"]["to_robot"].passed > 5


async def test_a_robot_link_between_the_sides_takes_the_robots_paths() -> None:
    slow = Impairment(delay=Constant(0.01))
    profile = Profile("x", robot_media=even_profile("", slow).media)
    link = (
        "import asyncio, sys\nfrom lockstep.robot_bridge.link.link_client import RobotLink\n"
        "async def main():\n"
        "    async with RobotLink(sys.argv[1], 5600, 'media') as link:\n"
        "        while (kind := type(await anext(link)).__name__) != 'Media': pass\n"
        "        print(kind, flush=True)\n"
        "asyncio.run(main())"
    )
    async with Namespaces(profile) as spaces:
        run = f"robot planar --host {ROBOT_ADDRESS} --json --insecure-link".split()
        bridge = await spaces.start("robot", [LOCKSTEP, *run], stdout=PIPE)
        assert "robot" in json.loads(await line(bridge))
        client = await spaces.start("operator", python(link, ROBOT_ADDRESS), stdout=PIPE)
        assert await line(client) == "Media"
        counts = spaces.statistics()
    assert counts.paths["robot_media"]["to_operator"].passed >= 3


CLOUD = "203.0.113.7"

WATCH = """
import asyncio, sys
from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console

async def main():
    async with Console(sys.argv[1], audio=False, connect_seconds=float(sys.argv[2])) as console:
        async for picture in console.pictures():
            break
        await console.restart_ice()
        print("picture", flush=True)

try:
    asyncio.run(main())
except Exception as error:
    print(type(error).__name__, flush=True)
"""


@pytest.mark.parametrize(("advertise", "seen"), [(("--advertise", CLOUD), "picture"), ((), "ConnectFailed")])
async def test_a_console_in_a_cloud_is_seen_from_home_by_the_outer_address_that_it_advertises(
    tmp_path: Path, advertise: tuple[str, ...], seen: str
) -> None:
    environment = os.environ | {"LOCKSTEP_STATE_DIR": str(tmp_path)}
    up = ["up", "--json", "--robot", "planar", "--host", "0.0.0.0", "--port", "8000", "--robot-port", "0", "--quiet"]
    async with Namespaces(Profile("perfect"), cloud=CLOUD) as spaces:
        console = await spaces.start("robot", [LOCKSTEP, *up, *advertise], stdout=PIPE, env=environment)
        links = json.loads(await line(console))
        assert links["console"] == f"http://{CLOUD if advertise else ROBOT_ADDRESS}:8000"
        link = links["observer"].replace(ROBOT_ADDRESS, CLOUD)
        client = await spaces.start("operator", python(WATCH, link, "30" if advertise else "6"), stdout=PIPE)
        assert await line(client) == seen


PAIR = """
import httpx, sys
console, token = sys.argv[1].split("/#token=")
answer = httpx.post(console + "/api/dial-in/code", headers={"Authorization": f"Bearer {token}"}, verify=False)
print(answer.json()["command"], flush=True)
"""

TURN = """
import asyncio, json, sys
from pathlib import Path
from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console

async def main():
    async with Console(sys.argv[1], tolerance=4, audio=False, connect_seconds=20, tls_ca=Path(sys.argv[2])) as console:
        await console.take_seat()
        for _ in range(5):
            feedback = await drive_on(console, [0.0, 0.0, 0.3])
        print(json.dumps({"event": feedback.event}), flush=True)

asyncio.run(main())
"""


async def says(process: asyncio.subprocess.Process, *words: str) -> None:
    """Wait until it has written a line with all these words on its standard error."""
    assert process.stderr is not None
    async with asyncio.timeout(60):
        while said := (await process.stderr.readline()).decode():
            if all(word in said for word in words):
                return
    raise AssertionError(f"it ended without {words}")


async def test_a_robot_that_nobody_can_reach_pairs_with_a_console_in_a_cloud_and_comes_back_after_an_outage(
    tmp_path: Path,
) -> None:
    """The robot and its driver are at home, behind a firewall; the console has its port for HTTP and one for media."""
    environment = os.environ | {"LOCKSTEP_STATE_DIR": str(tmp_path / "console")}
    serve = ["serve", "--json", "--robot", "dial-in", "--host", "0.0.0.0", "--port", "8000", "--tls", "self-signed"]
    serve += ["--advertise", CLOUD, "--media-port", "40000"]
    async with Namespaces("lte-drive", cloud=CLOUD) as spaces:
        console = await spaces.start("robot", [LOCKSTEP, *serve], stdout=PIPE, stderr=PIPE, env=environment)
        links = json.loads(await line(console))
        pairing = await spaces.start("operator", python(PAIR, links["supervisor"]), stdout=PIPE)
        command = (await line(pairing)).split()
        assert command[:4] == ["lockstep", "robot", "NAME", "--console"]
        dial = [LOCKSTEP, "robot", "planar", "--json", *command[3:], "--state-dir", str(tmp_path / "robot")]
        robot = await spaces.start("operator", dial, stdout=PIPE)
        assert json.loads(await line(robot)) == {"console": f"wss://{CLOUD}:8000"}
        trusted = str(tmp_path / "console" / "tls-cert.pem")
        drive = python(TURN, links["operator"], trusted)
        first = json.loads(await line(await spaces.start("operator", drive, stdout=PIPE)))
        await says(console, "role='operator'", "link up")
        spaces.outage(4.0)
        await says(console, "link down")
        await says(console, "role='operator'", "link up")
        again = json.loads(await line(await spaces.start("operator", drive, stdout=PIPE)))
    assert again["event"] > first["event"] >= 5
