"""Settings of the Foxglove server: LOCKSTEP_FOXGLOVE__…"""

import ipaddress
from typing import Annotated, Self

from pydantic import BaseModel, Field, model_validator

__all__ = ["FoxgloveSettings"]


class FoxgloveSettings(BaseModel):
    """The address of the Foxglove server. It asks for no link, so it listens on loopback unless `public` is set."""

    port: Annotated[int, Field(ge=0, le=65535)] | None = None  # None: there is no server; 0: any free port
    host: str = "127.0.0.1"  # address of this machine
    public: bool = False  # listen where other machines connect too

    @model_validator(mode="after")
    def _check_host(self) -> Self:
        try:
            loopback = ipaddress.ip_address(self.host).is_loopback
        except ValueError as error:
            raise ValueError(f"host: {self.host!r} is not an IP address of this machine") from error
        if not loopback and not self.public:
            raise ValueError(
                f"everybody who reaches {self.host} would see pictures and sound without a link; "
                "set public (LOCKSTEP_FOXGLOVE__PUBLIC=true) if that is wanted"
            )
        return self
