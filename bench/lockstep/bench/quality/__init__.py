"""Measures the quality controller and the repair of losses behind a bad network (`--help`)."""
