"""Configures a separate Janus in a directory, for a start by its command, never as a service."""

import shutil
from pathlib import Path

__all__ = ["JANUS_READY", "janus_command"]

JANUS_READY = "WebSockets thread started"  # in its log, once it answers

CORE = """
general: {{
    configs_folder = "{folder}"
    debug_level = 4
    debug_timestamps = false
    debug_colors = false
    session_timeout = 60
    server_name = "lockstep"
    event_loops = 1
}}
media: {{ rtp_port_range = "{first_port}-{last_port}" }}
nat: {{ ignore_mdns = true }}
plugins: {{ disable = "{other_plugins}" }}
transports: {{ disable = "{other_transports}" }}
events: {{ broadcast = false }}
"""
WEBSOCKETS = """
general: {{
    json = "compact"
    ws = true
    ws_port = {port}
    ws_ip = "{address}"
    wss = false
}}
admin: {{ admin_ws = false }}
"""
VIDEOROOM = "general: {{ {admin_key} }}\n"
OTHER_PLUGINS = (
    "audiobridge", "duktape", "echotest", "lua", "nosip", "recordplay", "sip", "streaming", "textroom", "videocall",
    "voicemail",
)  # fmt: skip
OTHER_TRANSPORTS = ("http", "mqtt", "nanomsg", "pfunix", "rabbitmq")


def janus_command(folder: Path, address: str, port: int, *, number: int = 0, admin_key: str = "") -> list[str]:
    """Write the configuration into `folder`, and return the command that runs Janus until it is killed.

    Args:
        number: of several in one network; each has its own ports for media
        address: to listen on; media go over every address but loopback, which Janus leaves out
        admin_key: needed to create a room; "": none is needed

    Raises:
        FileNotFoundError: Janus is not installed.
    """
    program = shutil.which("janus")
    if program is None:
        raise FileNotFoundError("Janus is not installed: Debian's package is called janus")
    folder.mkdir(parents=True, exist_ok=True)
    core = CORE.format(
        folder=folder,
        first_port=20_000 + 5_000 * number,
        last_port=24_999 + 5_000 * number,
        other_plugins=",".join(f"libjanus_{name}.so" for name in OTHER_PLUGINS),
        other_transports=",".join(f"libjanus_{name}.so" for name in OTHER_TRANSPORTS),
    )
    (folder / "janus.jcfg").write_text(core)
    (folder / "janus.transport.websockets.jcfg").write_text(WEBSOCKETS.format(port=port, address=address))
    key = f'admin_key = "{admin_key}"' if admin_key else ""
    (folder / "janus.plugin.videoroom.jcfg").write_text(VIDEOROOM.format(admin_key=key))
    return [program, f"--config={folder / 'janus.jcfg'}", f"--configs-folder={folder}", "--log-stdout"]
