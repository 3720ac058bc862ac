"""Checks which clients get through which kinds of network: `lockstep interoperability`."""
