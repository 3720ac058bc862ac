"""docker-compose.yml and the Dockerfile, as far as they can be checked without an engine."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from lockstep.server.fleet.robots import robot_settings
from lockstep.server.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
PROFILES = ("public", "monitoring", "redis")


def _services() -> dict[str, dict[str, Any]]:
    services: dict[str, dict[str, Any]] = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
    return services


SERVICES = _services()


def _short(volume: str | dict[str, Any]) -> str:
    """A volume in the short form, with the default of a variable in its place."""
    if isinstance(volume, str):
        return volume
    source = re.sub(r"\$\{\w+:-([^}]+)\}", r"\1", volume["source"])
    return f"{source}:{volume['target']}{':ro' if volume.get('read_only') else ''}"


def _resolved(folder: Path = ROOT, /, **variables: str) -> dict[str, dict[str, Any]]:
    """The services as Compose understands them with `variables` in the environment; with `.env` if `folder` has one."""
    environment = {"PATH": os.environ["PATH"], "HOME": os.environ["HOME"], **variables}
    done = subprocess.run(
        ["docker-compose", "config"], cwd=folder, env=environment, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    services: dict[str, dict[str, Any]] = yaml.safe_load(done.stdout)["services"]
    return services


def _console_settings(monkeypatch: pytest.MonkeyPatch, **variables: str) -> Settings:
    """The settings that the console gets in its container: from its environment and from the file that is mounted."""
    console = _resolved(**variables)["console"]
    (mounted,) = (each for each in console["volumes"] if isinstance(each, dict))
    given = {name: value for name, value in console["environment"].items() if value is not None}
    given["LOCKSTEP_CONFIG"] = given["LOCKSTEP_CONFIG"].replace(mounted["target"], mounted["source"])
    for name in ("LOCKSTEP_LINK_SECRET_FILE", "LOCKSTEP_TURN_SECRET_FILE"):  # those are in volumes
        del given[name]
    for name in [name for name in os.environ if name.startswith("LOCKSTEP_")]:
        monkeypatch.delenv(name)
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    assert not console.get("command"), "a flag would go before the file"
    return Settings()


def _users_of_the_images() -> dict[str, str]:
    """The last USER of every stage of the Dockerfile."""
    users: dict[str, str] = {}
    parents: dict[str, str] = {}
    stage = ""
    for line in (ROOT / "Dockerfile").read_text().splitlines():
        if match := re.match(r"FROM (\S+) AS (\S+)", line):
            parents[match[2]], stage = match[1], match[2]
        elif line.startswith("USER "):
            users[stage] = line.removeprefix("USER ").strip()
    return {stage: users.get(stage) or users.get(parents[stage], "root") for stage in parents}


@pytest.mark.parametrize("profiles", [(), ("public",), ("monitoring",), PROFILES])
def test_compose_accepts_the_file_with_no_settings_at_all(profiles: tuple[str, ...]) -> None:
    chosen = [part for profile in profiles for part in ("--profile", profile)]
    done = subprocess.run(
        ["docker-compose", *chosen, "config", "--quiet"], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("name", SERVICES)
def test_every_service_has_a_health_check_and_a_read_only_file_system(name: str) -> None:
    service = SERVICES[name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    if name != "secrets":  # it ends by itself
        assert service["healthcheck"]["test"][0] == "CMD"


@pytest.mark.parametrize("name", SERVICES)
def test_no_service_runs_as_root(name: str) -> None:
    service = SERVICES[name]
    user = service.get("user") or _users_of_the_images()[service["build"]["target"]]
    assert user not in ("root", "0")


def test_only_the_proxy_may_gain_a_privilege_and_only_that_of_low_ports() -> None:
    gained = {name: service["cap_add"] for name, service in SERVICES.items() if "cap_add" in service}
    assert gained == {"caddy": ["NET_BIND_SERVICE"]}
    relaxed = [name for name, service in SERVICES.items() if service["security_opt"] != ["no-new-privileges:true"]]
    assert relaxed == ["caddy"]


def test_the_robot_link_and_the_measurements_are_published_on_loopback_only() -> None:
    published = [port for service in SERVICES.values() for port in service.get("ports", [])]
    assert published
    assert all(port.startswith("127.0.0.1:") for port in published)
    assert "--web.listen-address=127.0.0.1:9090" in SERVICES["prometheus"]["command"]
    assert SERVICES["grafana"]["environment"]["GF_SERVER_HTTP_ADDR"] == "127.0.0.1"


def test_every_secret_is_seen_by_those_alone_who_need_it() -> None:
    """What faces the Internet, the relay and the proxy, has no way to the robot link's."""
    seen = {
        secret: {
            name
            for name, service in SERVICES.items()
            if any(_short(volume).startswith(f"{secret}:") for volume in service.get("volumes", []))
        }
        for secret in ("link-secret", "turn-secret")
    }
    assert seen == {"link-secret": {"secrets", "robot", "console"}, "turn-secret": {"secrets", "console", "coturn"}}
    writing = [
        (name, volume)
        for name, service in SERVICES.items()
        for volume in map(_short, service.get("volumes", []))
        if "-secret:" in volume and not volume.endswith(":ro")
    ]
    assert {name for name, _ in writing} == {"secrets"}


def test_every_file_that_is_mounted_or_copied_exists() -> None:
    volumes = [volume for service in SERVICES.values() for volume in service.get("volumes", [])]
    mounted = [volume.split(":")[0] for volume in map(_short, volumes) if volume.startswith("./")]
    copied = re.findall(r"^COPY (?!--from)(.+) \S+$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)
    missing = [path for path in [*mounted, *" ".join(copied).split()] if not (ROOT / path).exists()]
    assert mounted
    assert missing == []


def _images_of_others() -> dict[str, str]:
    """The image that each variable names unless it is set, in both files."""
    texts = [(ROOT / name).read_text() for name in ("docker-compose.yml", "Dockerfile")]
    found = re.findall(r"\$\{(\w+_IMAGE):-([^}]+)\}", texts[0])
    found += re.findall(r"^ARG (\w+_IMAGE)=(\S+)$", texts[1], re.MULTILINE)
    assert len({*found}) == len({name for name, _ in found}), "both files name the same image"
    return dict(found)


def test_images_of_others_are_pinned_to_a_version() -> None:
    images = _images_of_others()
    assert len(images) >= 7
    assert [image for image in images.values() if not re.search(r":v?\d+", image)] == []


def test_every_image_of_others_can_be_named_by_its_digest() -> None:
    """Nothing is pulled but by a variable, which docs/deploy.md tells to set to a digest."""
    variables = set(_images_of_others())
    pulled = [service["image"] for service in SERVICES.values() if "image" in service]
    assert [image for image in pulled if not image.startswith("${")] == []
    stages = re.findall(r"^FROM (\S+) AS (\S+)$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)
    made = {name for _, name in stages}
    assert [parent for parent, _ in stages if parent not in made and not parent.startswith("${")] == []
    digest = "example.test/any@sha256:" + 64 * "0"
    environment = {"PATH": os.environ["PATH"], "HOME": os.environ["HOME"], **dict.fromkeys(variables, digest)}
    chosen = [part for profile in PROFILES for part in ("--profile", profile)]
    done = subprocess.run(
        ["docker-compose", *chosen, "config"], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    services = yaml.safe_load(done.stdout)["services"]
    assert {each["image"] for each in services.values() if "build" not in each} == {digest}
    built = {name: each["build"]["args"] for name, each in services.items() if "build" in each}
    assert all(set(given.values()) == {digest} for given in built.values()), built


def _copied(folder: Path, **variables: str) -> Path:
    """A folder with the file and with `variables` in `.env`."""
    shutil.copy(ROOT / "docker-compose.yml", folder)
    (folder / ".env").write_text("".join(f"{name}={value}\n" for name, value in variables.items()))
    return folder


def _passed_on() -> list[str]:
    """The console's variables that have no value in the file."""
    return [name for name, value in SERVICES["console"]["environment"].items() if value is None]


def test_a_variable_without_a_value_is_given_if_the_file_of_variables_has_it(tmp_path: Path) -> None:
    wanted = {name: f"value-{number}" for number, name in enumerate(_passed_on())}
    assert len(wanted) >= 10
    found = _resolved(_copied(tmp_path, **wanted))["console"]["environment"]
    assert {name: found[name] for name in wanted} == wanted


def test_a_variable_without_a_value_is_not_given_if_nothing_has_it_and_may_be_empty(tmp_path: Path) -> None:
    first, *others = _passed_on()
    found = _resolved(_copied(tmp_path, **{first: ""}))["console"]["environment"]
    assert (found[first], {found.get(name) for name in others}) == ("", {None})


def test_a_variable_of_the_shell_goes_before_the_file_of_variables(tmp_path: Path) -> None:
    folder = _copied(tmp_path, LOCKSTEP_ROBOT="dial-in", LOCKSTEP_PORT="8001", LOCKSTEP_LINK_SECRET_FILE="")
    found = _resolved(folder, LOCKSTEP_ROBOT="tcp://10.0.0.5:5600")["console"]["environment"]
    names = ("LOCKSTEP_ROBOT", "LOCKSTEP_PORT", "LOCKSTEP_LINK_SECRET_FILE")
    assert [found[name] for name in names] == ["tcp://10.0.0.5:5600", "8001", ""]


@pytest.mark.parametrize(("given", "used"), [({}, "/run/lockstep/link/link_secret"), ({"SECRET_FILE": ""}, "")])
def test_without_a_key_file_the_console_pairs_a_robot_that_dials_in(given: dict[str, str], used: str) -> None:
    """A console with a key file takes no code."""
    variables = {f"LOCKSTEP_LINK_{name}": value for name, value in given.items()}
    assert _resolved(**variables)["console"]["environment"]["LOCKSTEP_LINK_SECRET_FILE"] == used


def test_without_a_file_of_its_own_the_console_has_the_robot_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    found = _console_settings(monkeypatch)
    assert (found.robot, found.port, found.media_port, found.media_tcp) == ("tcp://127.0.0.1:5600", 8000, 40000, False)
    assert (found.is_fleet, str(found.state_dir)) == (False, "/var/lib/lockstep")


def test_the_image_of_the_console_gives_no_flag_that_would_go_before_a_file_or_a_variable() -> None:
    _, stage = (ROOT / "Dockerfile").read_text().split(" AS console\n")
    stage = stage.partition("\nFROM ")[0]
    assert 'ENTRYPOINT ["lockstep", "serve"]' in stage
    assert "\nCMD" not in stage


@pytest.mark.parametrize(
    ("robot", "names"), [("dial-in", []), ("tls://10.0.0.5:5600", []), ("left=tcp://127.0.0.1:5600", ["left"])]
)
def test_a_variable_names_the_robot(robot: str, names: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    found = _console_settings(monkeypatch, LOCKSTEP_ROBOT=robot)
    assert (list(robot_settings(found)) if found.is_fleet else []) == names
    assert found.is_fleet or found.robot == robot


def test_a_folder_of_settings_has_a_fleet_and_variables_go_before_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = """
        public_url = "https://file.example.org"
        ice_hosts = ["10.0.0.2"]
        media_port = 41000
        media_tcp = true
        [robots.left]
        robot = "dial-in"
        [robots.right]
        robot = "tls://10.0.0.6:5600"
    """
    (tmp_path / "console.toml").write_text(text)
    found = _console_settings(monkeypatch, LOCKSTEP_CONFIG_DIR=str(tmp_path))
    assert (found.public_url, found.ice_hosts) == ("https://file.example.org", ("10.0.0.2",))
    assert (found.media_port, found.media_tcp) == (41000, True)
    robots = {name: each.robot for name, each in robot_settings(found).items()}
    assert robots == {"left": "dial-in", "right": "tls://10.0.0.6:5600"}
    both = {"LOCKSTEP_CONFIG_DIR": str(tmp_path), "LOCKSTEP_PUBLIC_URL": "https://env.example.org"}
    assert _console_settings(monkeypatch, **both).public_url == "https://env.example.org"


def test_the_folder_of_settings_is_mounted_for_reading_alone() -> None:
    (mounted,) = (each for each in SERVICES["console"]["volumes"] if isinstance(each, dict))
    assert (mounted["target"], mounted["read_only"]) == ("/etc/lockstep", True)


def test_the_robot_can_be_left_out_and_takes_options() -> None:
    """Compose waits for no service of scale 0."""
    usual = _resolved()["robot"]
    assert (usual["scale"], shlex.split(usual["command"])[0]) == (1, "mobile-manipulator")
    assert _resolved(LOCKSTEP_ROBOT_CONTAINERS="0")["robot"]["scale"] == 0
    options = "--encode h264 --console wss://203.0.113.7:8000 --pair K7-3F9QW-2MXBD"
    name, *words = shlex.split(
        _resolved(LOCKSTEP_ROBOT_NAME="planar", LOCKSTEP_ROBOT_OPTIONS=options)["robot"]["command"]
    )
    assert (name, words[-6:]) == ("planar", options.split())
    command = [str(Path(sys.executable).with_name("lockstep")), "robot", "--help"]
    environment = {"COLUMNS": "200", "PATH": "/usr/bin"}
    told = subprocess.run(command, capture_output=True, text=True, timeout=60, env=environment).stdout
    assert [word for word in words if word.startswith("--") and word not in told] == []


def test_a_robot_that_dials_out_still_has_the_port_that_its_health_check_asks() -> None:
    robot = _resolved(LOCKSTEP_ROBOT_OPTIONS="--console wss://203.0.113.7:8000")["robot"]
    words = shlex.split(robot["command"])
    assert "--listen" in words
    assert words[words.index("--port") + 1] in robot["healthcheck"]["test"][-1]
