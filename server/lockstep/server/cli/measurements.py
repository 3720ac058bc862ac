"""Commands that measure. They are in `bench/`, which is imported only when one is asked for.

Where `bench/` is not installed, as in the images, there are no such commands.
"""

from importlib.util import find_spec
from typing import Any

import typer

from lockstep.server.cli.extras import load_extra

__all__ = ["add_bench_commands"]

# name → module and function that typer can run, and its text in `lockstep --help`
COMMANDS = {
    "experiment": (
        "lockstep.bench.experiment.cli",
        "experiment_command",
        "Repeat the thesis' experiments on emulated networks.",
    ),
    "fleet-soak": (
        "lockstep.bench.fleet_soak.cli",
        "fleet_soak_command",
        "Drive several robots while their bridges die in turn.",
    ),
    "network": (
        "lockstep.emulator.cli",
        "network_command",
        "Put a bad network between a console and whoever uses it.",
    ),
    "hostile": ("lockstep.bench.hostile.cli", "hostile_command", "Drive among peers that misbehave in every way."),
    "interoperability": (
        "lockstep.bench.interoperability.cli",
        "interoperability_command",
        "Drive with each client over each network.",
    ),
    "soak": ("lockstep.bench.soak.cli", "soak_command", "Drive for a long time while everything fails now and then."),
    "soak-day": (
        "lockstep.bench.soak_day.cli",
        "soak_day_command",
        "Go on with a day of use that is compressed into two hours.",
    ),
}


def add_bench_commands(app: typer.Typer) -> None:
    if find_spec("lockstep.bench") is None:
        return
    for name in COMMANDS:
        _add(app, name)


def _add(app: typer.Typer, name: str) -> None:
    module, function, about = COMMANDS[name]

    def run(context: typer.Context) -> None:
        command: Any = getattr(load_extra(module, "dev"), function)
        measuring = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        measuring.command()(command)
        measuring(context.args, prog_name=f"lockstep {name}")

    # Its own parser sees everything, --help included.
    everything = {"ignore_unknown_options": True, "allow_extra_args": True}
    app.command(
        name, help=about, add_help_option=False, context_settings=everything, rich_help_panel="Measure and try"
    )(run)
