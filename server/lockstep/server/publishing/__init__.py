"""Clients that publish a camera by WHIP, from the answer to the end."""
