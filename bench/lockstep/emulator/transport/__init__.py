"""Forwarders and proxies that lead UDP, TCP, HTTP and WebSockets over a path."""
