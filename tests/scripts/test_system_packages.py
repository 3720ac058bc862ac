"""`scripts/system-packages` names what it could not install, and fails. Debian's programs here are the test's own."""

import os
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "system-packages"
INSTALLED = "#!/bin/sh\necho install ok installed\n"
UNKNOWN = "#!/bin/sh\nexit 1\n"
WORKS = "#!/bin/sh\nexit 0\n"
OFFLINE = '#!/bin/sh\necho "Temporary failure resolving the server" >&2\nexit 100\n'
NO_SUCH = '#!/bin/sh\n[ "$1" = update ] || exit 100\n'


def _run(folder: Path, **programs: str) -> subprocess.CompletedProcess[str]:
    for name, text in {"id": "#!/bin/sh\necho 0\n", **programs}.items():
        program = folder / name.replace("_", "-")
        program.write_text(text)
        program.chmod(0o755)
    path = f"{folder}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        [str(SCRIPT), "coturn", "janus"], capture_output=True, text=True, timeout=60, env={**os.environ, "PATH": path}
    )


def test_with_all_installed_it_says_and_asks_nothing(tmp_path: Path) -> None:
    done = _run(tmp_path, dpkg_query=INSTALLED, apt_get=OFFLINE)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_what_is_missing_is_installed(tmp_path: Path) -> None:
    done = _run(tmp_path, dpkg_query='#!/bin/sh\n[ "$1" = -L ]\n', apt_get=WORKS)
    assert (done.returncode, done.stdout, done.stderr) == (0, "Installing coturn janus\n", "")


@pytest.mark.parametrize("apt_get", [OFFLINE, NO_SUCH], ids=["offline", "no such package"])
def test_what_cannot_be_installed_is_named(apt_get: str, tmp_path: Path) -> None:
    done = _run(tmp_path, dpkg_query=UNKNOWN, apt_get=apt_get)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "These packages are missing and could not be installed: coturn janus"


def test_where_root_refuses_what_is_missing_is_named(tmp_path: Path) -> None:
    done = _run(tmp_path, dpkg_query=UNKNOWN, id="#!/bin/sh\necho 1000\n", sudo=OFFLINE)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "These packages are missing and could not be installed: coturn janus"
