"""Runs a console from start to end: its own bridges first, then HTTP, then the links."""

import asyncio
import datetime
import gc
import json
import logging
import os
import socket
import sys
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path

import typer
from fastapi import FastAPI

from lockstep.robot_bridge.service_manager import ServiceManager
from lockstep.rtc.interfaces import own_addresses
from lockstep.server.cli.console_address import ConsoleAddress, forget_listener, local_url, write_address
from lockstep.server.composition.robot_app import create_app
from lockstep.server.fleet.fleet import Fleet
from lockstep.server.fleet.fleet_app import create_fleet_app
from lockstep.server.fleet.robots import robot_settings
from lockstep.server.http.transport.serve import running, stop_signals
from lockstep.server.http.transport.tls import Certificate, ends_at, fingerprint, own_names, self_signed, shown_by
from lockstep.server.http.transport.uvicorn_http_limits import bounded_by
from lockstep.server.robot.bridge_process import BridgeProcess
from lockstep.server.robot.dial_in import DIAL_IN
from lockstep.server.robot.robot_connection import RobotConnection
from lockstep.server.settings import Settings
from lockstep.server.state.console_links import ConsoleLinks, console_links, listening_url
from lockstep.server.state.persistent_state import ConsoleState
from lockstep.server.util.state_dir import StateDirUnusable

__all__ = ["ConsoleFailed", "run_console", "say"]

PATIENCE = 2.0  # s until people are told that the console waits for a robot
SIGNS_OF_LIFE = 4  # in each time after which the service manager restarts a silent console
GC_THRESHOLDS = (5_000, 20, 10)  # allocations, young collections, middle collections


_logger = logging.getLogger(__name__)


class ConsoleFailed(Exception):
    """The console has failed. Its supervisor should start it anew: it would answer nobody any more."""


async def run_console(
    settings: Settings,
    state: ConsoleState,
    listener: socket.socket,
    bridges: Mapping[str, BridgeProcess],
    as_json: bool,
) -> None:
    """Run until a signal. The bridges start before the console, and end after it.

    Args:
        bridges: the console's own, by the robots' names; "" is the only robot of a console

    Raises:
        ConsoleFailed: the log says why.
    """
    certificate = _certificate(settings, state.directory.path)
    service = ServiceManager(os.environ)
    try:
        with stop_signals() as asked:
            addresses = await _start(bridges, asked)
            if addresses is None:
                return
            settings = _with_addresses(settings, addresses)
            application = _application(settings, state)
            http = bounded_by(settings, application)
            async with running(application, listener, http=http, tls=certificate), asyncio.TaskGroup() as tasks:
                if certificate is not None:
                    application.state.context.metrics.certificate_end.set(ends_at(certificate))
                _calm_garbage_collection()
                background = [tasks.create_task(bridge.watch()) for bridge in bridges.values()]
                url = listening_url(settings, listener)
                local = local_url(listener, encrypted=certificate is not None)
                address = ConsoleAddress(url, local, "" if certificate is None else shown_by(certificate))
                links = console_links(settings, url, state)
                with suppress(StateDirUnusable):  # `lockstep invite` then needs --url
                    write_address(state.directory, address)
                background.append(tasks.create_task(_announce(application, links, as_json)))
                background.append(tasks.create_task(_report(service)))
                stopping = tasks.create_task(asked.wait())
                failed = tasks.create_task(application.state.failed.wait())
                await asyncio.wait((stopping, failed), return_when=asyncio.FIRST_COMPLETED)
                service.stopping()
                with suppress(StateDirUnusable):
                    forget_listener(state.directory, address)
                for task in (*background, stopping, failed):
                    task.cancel()
            if not asked.is_set():
                raise ConsoleFailed
    except ExceptionGroup as errors:
        _logger.error("the console has failed", exc_info=errors)
        raise ConsoleFailed from errors
    finally:
        service.close()
        listener.close()
        await asyncio.gather(*(bridge.close() for bridge in bridges.values()))


async def _report(service: ServiceManager) -> None:
    """Tell the service manager that the console listens, and from then on that its event loop goes on."""
    service.ready()
    if service.watchdog_seconds is not None:
        while True:
            service.alive()
            await asyncio.sleep(service.watchdog_seconds / SIGNS_OF_LIFE)


def say(text: str) -> None:
    typer.echo(f"lockstep: {text}", err=True)


async def _start(bridges: Mapping[str, BridgeProcess], asked: asyncio.Event) -> dict[str, str] | None:
    """Start the bridges and return their addresses; None when the signal to stop comes first.

    One that does not start ends all: the user wants them all.
    """
    try:
        async with asyncio.TaskGroup() as tasks:
            starting = {name: tasks.create_task(bridge.start()) for name, bridge in bridges.items()}
            stopping = tasks.create_task(_cancel_at(asked, starting.values()))
            if starting:
                await asyncio.wait(starting.values())
            stopping.cancel()
    except BaseExceptionGroup as errors:
        if asked.is_set():
            return None
        raise errors.exceptions[0] from None
    return None if asked.is_set() else {name: each.result() for name, each in starting.items()}


async def _cancel_at(asked: asyncio.Event, tasks: Collection[asyncio.Task[str]]) -> None:
    await asked.wait()
    for each in tasks:
        each.cancel()


def _with_addresses(settings: Settings, addresses: Mapping[str, str]) -> Settings:
    if not addresses:
        return settings
    if "" in addresses:
        return settings.model_copy(update={"robot": addresses[""]})
    return settings.model_copy(update={"robots": tuple(f"{name}={address}" for name, address in addresses.items())})


def _application(settings: Settings, state: ConsoleState) -> FastAPI:
    if settings.is_fleet:
        return create_fleet_app(settings, robot_settings(settings), state)
    return create_app(settings, state)


def _calm_garbage_collection() -> None:
    """Make collections rare: a full one over all modules stalls the loop by 100 ms and more with a hundred peers.

    Objects that live now live until the end, so they are frozen; the others are collected less often.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(*GC_THRESHOLDS)


def _certificate(settings: Settings, directory: Path) -> Certificate | None:
    """Return the certificate for HTTPS; None: no encryption. Raises StateDirUnusable."""
    if settings.tls_cert is not None and settings.tls_key is not None:
        return Certificate(settings.tls_cert, settings.tls_key)
    if not settings.tls:
        return None
    names = own_names(settings.host) | set(settings.tls_names) | set(settings.own_names) | set(own_addresses())
    names |= set(settings.advertise)
    try:
        certificate = self_signed(directory, names - {"*"}, datetime.datetime.now(datetime.UTC))
    except OSError as error:
        raise StateDirUnusable(directory, f"{error.filename}: {error.strerror}") from error
    say(f"the console made its certificate itself; the SHA-256 fingerprint is {fingerprint(certificate)}")
    return certificate


async def _announce(application: FastAPI, links: ConsoleLinks, as_json: bool) -> None:
    """Print the links, once they lead to a robot. People are told meanwhile that the robot is not there yet.

    In a fleet no robot holds up the others: one that is not there after a while is named, and the links are printed.
    """
    fleet = getattr(application.state, "fleet", None)
    if isinstance(fleet, Fleet):
        robots = {name: each.dependencies.console.robot for name, each in fleet.sessions.items() if each.dependencies}
        links = links._replace(robot="", robots={name: each.settings.robot for name, each in fleet.sessions.items()})
    else:
        robots = {"": application.state.dependencies.console.robot}
    if not as_json or links.robots:
        await _wait_for_all(robots)
        for name, robot in robots.items():
            if not robot.up:
                at = "" if links.address(name) == DIAL_IN else f" at {links.address(name)}"
                say(f"waiting for the robot{f' {name}' if name else ''}{at}: {robot.detail}")
    if not links.robots and links.robot != DIAL_IN:  # a supervisor pairs a robot that dials in, with a link
        await robots[""].reached.wait()
    sys.stdout.write(json.dumps(links.fields()) + "\n" if as_json else links.for_people())
    sys.stdout.flush()


async def _wait_for_all(robots: Mapping[str, RobotConnection]) -> None:
    with suppress(TimeoutError):
        async with asyncio.timeout(PATIENCE):
            for robot in robots.values():
                await robot.reached.wait()
