"""The routes, one file for each kind (docs/console-api.md)."""
