"""Sockets, TLS and the bounds on connections that uvicorn does not have."""
