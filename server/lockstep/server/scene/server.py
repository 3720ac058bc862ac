"""Starts viser. Imported when somebody opens the full 3D scene for the first time: loading viser takes a while."""

import logging

import rich
import viser

from lockstep.protocol.description import RobotDescription
from lockstep.server.scene.model import SceneModel
from lockstep.server.scene.page import ScenePage, read_scene_page

__all__ = ["build_model", "start_viser"]


def start_viser() -> tuple[viser.ViserServer, ScenePage]:
    """Start viser on a free port of loopback. Blocks until it listens.

    Raises:
        OSError, ValueError: its client cannot be read.
    """
    # viser announces itself and every refusal on standard output, which belongs to the console's own links.
    rich.get_console().quiet = True
    logging.getLogger("websockets.server").setLevel(logging.ERROR)
    server = viser.ViserServer(host="127.0.0.1", port=0, label="Scene", verbose=False)
    server.gui.main_panel.minimize()
    server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
    try:
        return server, read_scene_page(server.get_port())
    except BaseException:
        server.stop()
        raise


def build_model(server: viser.ViserServer, description: RobotDescription, factor: float) -> SceneModel:
    """Build the robot in the scene, in place of the previous one."""
    with server.atomic():
        server.scene.reset()
        return SceneModel(server, description, factor)
