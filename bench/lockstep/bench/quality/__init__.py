"""What the quality controller and the repair of losses do behind a bad network (`--help`)."""
