"""The wheels that `make dist` builds, in clean environments: the bridge alone, and everything."""

import asyncio
import re
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from pathlib import Path

import pytest

from lockstep.robot_bridge.link.link_client import RobotLink
from tests.support.stack import running_stack

ROOT = Path(__file__).parents[2]
PARTS = ("protocol", "rtc", "robot_bridge", "client", "server", ".")
PLUGINS = ("lerobot_robot_lockstep", "lerobot_teleoperator_lockstep")
BRIDGE = ("lockstep_protocol", "lockstep_bridge")
WITH_PAGE = "lockstep/server/web_dist/"

DRIVE = """
import asyncio, sys
from lockstep.client import Console

async def main():
    async with Console(sys.argv[1]) as console:
        await console.take_seat()
        for _ in range(20):
            feedback = await console.drive({"base.vx": 0.1})
        await console.rest()
        print("event", feedback.event)

asyncio.run(main())
"""


STILL = """
from lockstep.protocol.description import Axis, RobotDescription
from lockstep.robot_bridge.robots.base import Measurement, Robot

class Still(Robot):
    def describe(self):
        axis = Axis(name="x", label="X", unit="m/s", minimum=-1.0, maximum=1.0, slew=4.0, brake=8.0)
        return RobotDescription(name="still", label="Still", axes=(axis,), hold=0.3)

    def apply(self, values):
        pass

    def measure(self):
        return Measurement([0.0], [], [], [], True, [])

    def stop(self):
        pass
"""


def _run(*command: str | Path, timeout: float = 120) -> str:
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=timeout, check=False)
    assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """By the name of their distribution, as it stands in a file name."""
    folder = tmp_path_factory.mktemp("dist")
    _run(sys.executable, "-m", "scripts.build_wheels", folder)
    return {wheel.name.split("-")[0]: wheel for wheel in folder.glob("*.whl")}


def _environment(folder: Path) -> Path:
    _run(sys.executable, "-m", "venv", folder)
    return folder / "bin"


def test_all_parts_have_one_version_and_need_each_other_in_it() -> None:
    found = {part: tomllib.loads((ROOT / part / "pyproject.toml").read_text())["project"] for part in PARTS}
    names = {project["name"] for project in found.values()}
    assert len(names) == len(PARTS)
    assert {project["version"] for project in found.values()} == {"0.1.0"}
    text = "".join((ROOT / part / "pyproject.toml").read_text() for part in PARTS)
    asked = re.findall(r'"(lockstep-\w+)(?:\[\w+\])?==([\d.]+)"', text)
    assert len(asked) > 5
    assert {name for name, _ in asked} < names
    assert {version for _, version in asked} == {"0.1.0"}


def test_every_wheel_has_its_licence_and_the_consoles_has_the_page_with_its_notices(wheels: dict[str, Path]) -> None:
    assert len(wheels) == len(PARTS) + len(PLUGINS)
    for name, wheel in wheels.items():
        names = zipfile.ZipFile(wheel).namelist()
        assert {Path(each).name for each in names if ".dist-info/licenses/" in each} == {"LICENSE", "NOTICE"}
        own = name if name in PLUGINS else "lockstep"
        assert not [each for each in names if not each.startswith(own) or "__pycache__" in each]
    page = {name for name in zipfile.ZipFile(wheels["lockstep_console"]).namelist() if name.startswith(WITH_PAGE)}
    assert {f"{WITH_PAGE}{name}" for name in ("index.html", "licenses.md", "licenses-inter.txt")} <= page


def test_the_plugins_that_lerobot_finds_by_their_names_are_built_too(wheels: dict[str, Path]) -> None:
    for plugin in PLUGINS:
        names = zipfile.ZipFile(wheels[plugin]).namelist()
        assert {f"{plugin}/__init__.py", f"{plugin}/py.typed"} <= set(names)


def test_no_file_is_in_two_wheels(wheels: dict[str, Path]) -> None:
    names = [name for wheel in wheels.values() for name in zipfile.ZipFile(wheel).namelist()]
    assert len(names) == len(set(names))


async def test_a_bridge_alone_runs_a_robot_of_ones_own(wheels: dict[str, Path], tmp_path: Path) -> None:
    programs = _environment(tmp_path / "robot")
    pinned = tmp_path / "constraints.txt"  # the versions of the lock file; its hashes would ask for the wheels' too
    pinned.write_text("\n".join(re.findall(r"(?m)^[a-z0-9._-]+==[^\s;\\]+", (ROOT / "requirements.lock").read_text())))
    pip = (programs / "python", "-m", "pip", "--disable-pip-version-check", "-q", "install", "-c", pinned)
    await asyncio.to_thread(_run, *pip, *(wheels[name] for name in BRIDGE))
    installed = _run(programs / "python", "-m", "pip", "--disable-pip-version-check", "list", "--format", "freeze")
    assert not re.search("(?i)numpy|mujoco|fastapi|^av=", installed)
    said = _run(programs / "lockstep", "--help")
    assert "robot" in said
    assert " up " not in said
    (tmp_path / "still.py").write_text(STILL)
    command = (str(programs / "lockstep"), "robot", "still:Still", "--port", "0", "--json", "--state-dir", "state")
    refused = await asyncio.to_thread(
        subprocess.run, [*command, "--encode", "h264"], cwd=tmp_path, capture_output=True, text=True
    )
    assert (refused.returncode, "lockstep-bridge[encode]" in refused.stderr) == (2, True), refused.stderr
    process = await asyncio.create_subprocess_exec(*command, cwd=tmp_path, stdout=asyncio.subprocess.PIPE)
    try:
        assert process.stdout is not None
        async with asyncio.timeout(30):
            line = (await process.stdout.readline()).decode()
        port = int(re.findall(r":(\d+)", line)[-1])
        async with RobotLink("127.0.0.1", port, "operator", name="test") as link:
            assert link.hello.description is not None
            assert [axis.name for axis in link.hello.description.axes] == ["x"]
    finally:
        process.terminate()
        await process.wait()


async def test_everything_installed_drives_records_and_verifies(wheels: dict[str, Path], tmp_path: Path) -> None:
    programs = _environment(tmp_path / "all")
    pip = (programs / "python", "-m", "pip", "--disable-pip-version-check", "-q", "install", "--no-deps", "--no-index")
    await asyncio.to_thread(_run, *pip, *wheels.values())
    # Other people's packages are this environment's: a line in a .pth file adds a folder, and none of its .pth files.
    site = Path(_run(programs / "python", "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip())
    (site / "others.pth").write_text(sysconfig.get_path("purelib") + "\n")
    where = _run(programs / "python", "-c", "import lockstep.server; print(lockstep.server.__file__)").strip()
    assert where.startswith(str(tmp_path))
    recordings = tmp_path / "recordings"
    lockstep = programs / "lockstep"
    async with running_stack(tmp_path, lockstep=lockstep, extra=("--record", str(recordings))) as stack:
        said = await asyncio.to_thread(_run, programs / "python", "-c", DRIVE, stack.operator)
        assert int(said.split()[-1]) >= 20
    (recording,) = recordings.glob("*.mcap")
    assert "readable" in await asyncio.to_thread(_run, lockstep, "verify", recording)
