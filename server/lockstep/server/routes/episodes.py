"""Episodes over HTTP, for scripts (docs/episodes.md)."""

import secrets
from typing import Annotated

import msgspec
from fastapi import APIRouter, Depends, Request, Response

from lockstep.protocol.episodes import EpisodeOutcome, EpisodeReason, EpisodeRequest, EpisodeVerb, Task
from lockstep.server.auth.tokens import Right
from lockstep.server.errors import (
    ConsoleError,
    EpisodeEmpty,
    EpisodeOpen,
    NoEpisode,
    NotAllowed,
    NoTask,
    OtherEpisode,
    RecordingFailed,
    RecordingOff,
    RobotLinkDown,
    TooManyRequests,
)
from lockstep.server.http.json_response import json_answer
from lockstep.server.http.request_body import read_json
from lockstep.server.recording.episodes.episode_core import EpisodeRefused
from lockstep.server.state.dependencies import authorized, dependencies

__all__ = ["EpisodeBody", "router"]

router = APIRouter()
Caller = Annotated[Right, Depends(authorized)]

ERRORS: dict[EpisodeReason, type[ConsoleError]] = {
    "not_allowed": NotAllowed,
    "too_often": TooManyRequests,
    "recording_off": RecordingOff,
    "link_down": RobotLinkDown,
    "no_task": NoTask,
    "episode_open": EpisodeOpen,
    "no_episode": NoEpisode,
    "other_episode": OtherEpisode,
    "empty": EpisodeEmpty,
    "not_written": RecordingFailed,
}


class EpisodeBody(msgspec.Struct, frozen=True):
    """Body of POST /api/episode/{do}. Each kind of request uses its own fields."""

    episode: Annotated[str, msgspec.Meta(max_length=64)] = ""
    task: Task = ""
    outcome: EpisodeOutcome = ""
    text: Annotated[str, msgspec.Meta(max_length=200)] = ""


@router.get("/api/episode")
async def state(request: Request, caller: Caller) -> Response:
    return json_answer(dependencies(request).episodes.state())


@router.post("/api/episode/{do}")
async def ask(request: Request, caller: Caller, do: EpisodeVerb) -> Response:
    """The holder of the seat, and supervisors. `keep` is answered when the episode is on the disk."""
    body = await read_json(request, EpisodeBody)
    caller = await authorized(request)  # again: the right may have ended while the body came
    wanted = EpisodeRequest(
        id=secrets.token_hex(8), do=do, episode=body.episode, task=body.task, outcome=body.outcome, text=body.text
    )
    try:
        asked = dependencies(request).episodes.ask_by_http(caller.actor, caller.identity.expires, wanted)
        return json_answer(await asked)
    except EpisodeRefused as refused:
        raise ERRORS[refused.reason](refused.detail) from refused
