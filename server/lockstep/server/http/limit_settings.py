"""Settings that limit requests, connections and messages. docs/security.md says what each is for."""

from typing import Annotated

from pydantic import Field
from pydantic_settings import BaseSettings

__all__ = ["LimitSettings"]


class LimitSettings(BaseSettings):
    """Part of `Settings`. Rates in Hz, each after a burst."""

    max_request_rate: Annotated[float, Field(gt=0)] = 50.0  # HTTP requests per address; stop is never limited
    max_request_burst: Annotated[int, Field(ge=1)] = 1000
    max_refused_rate: Annotated[float, Field(gt=0)] = 1.0  # requests without a valid token, per address
    max_refused_burst: Annotated[int, Field(ge=1)] = 30
    max_offer_rate: Annotated[float, Field(gt=0)] = 5.0  # WHEP offers per token
    max_offer_burst: Annotated[int, Field(ge=1)] = 250
    max_unconnected: Annotated[int, Field(ge=1)] = 60  # peers of one token that have not connected yet
    reserved_places: Annotated[int, Field(ge=0)] = 10  # of max_peers; observers do not get these
    max_connections: Annotated[int, Field(ge=1)] = 1000  # TCP, all together
    max_address_connections: Annotated[int, Field(ge=1)] = 300  # TCP, per address, and per link
    max_stranger_rate: Annotated[float, Field(gt=0)] = 400.0  # pieces of HTTP without a good token, all together
    max_stranger_burst: Annotated[int, Field(ge=1)] = 2000
    request_timeout: Annotated[float, Field(gt=0)] = 10.0  # s to send a request, and to read a part of its answer
    max_observer_rate: Annotated[float, Field(gt=0)] = 20.0  # messages per observer; a page sends five
    max_bad_messages: Annotated[int, Field(ge=1)] = 100  # of one peer, then it is closed; two a second are forgiven
