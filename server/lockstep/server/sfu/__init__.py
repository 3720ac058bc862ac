"""Publishes the session to external SFU servers, for observers by the thousand."""
