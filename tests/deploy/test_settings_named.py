"""Settings that the deployment files name, against those that the programs have."""

import inspect
import re
from pathlib import Path

from lockstep.robot_bridge import cli as robot_cli
from lockstep.server.media.settings import MediaSettings
from lockstep.server.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
OTHERS = {  # not the programs' own
    "LOCKSTEP_SITE",  # Caddy
    "LOCKSTEP_HTTP_PORT",
    "LOCKSTEP_HTTPS_PORT",
    "LOCKSTEP_ONE",
    "LOCKSTEP_TWO",
    "LOCKSTEP_EXTERNAL_IP",  # coturn
    "LOCKSTEP_ROBOT_NAME",
    "LOCKSTEP_ROBOT_OPTIONS",  # of the robot's unit, and of Compose
    "LOCKSTEP_ROBOT_CONTAINERS",  # Compose's own
    "LOCKSTEP_CONFIG_DIR",
    "LOCKSTEP_ROS_SETUP",  # of the drop-in for ROS 2
    "LOCKSTEP_LINK",  # of `lockstep pair` and `forget`
    "LOCKSTEP_NAME",  # stands for any in a sentence
}


def _named(*paths: str) -> set[str]:
    texts = [file.read_text() for path in paths for file in ROOT.glob(path) if file.is_file()]
    return set(re.findall(r"\bLOCKSTEP_[A-Z_]+\b", "\n".join(texts))) - OTHERS


def test_every_setting_in_the_deployment_files_and_their_guide_exists() -> None:
    known = {f"LOCKSTEP_{name.upper()}" for name in Settings.model_fields}
    known |= {f"LOCKSTEP_MEDIA__{name.upper()}" for name in MediaSettings.model_fields}
    known |= set(re.findall(r"LOCKSTEP_[A-Z_]+", inspect.getsource(robot_cli)))
    named = _named("docker-compose.yml", "deploy/**/*", "docs/deploy.md")
    assert len(named) > 5
    assert named - known == set()
