"""The sending half of a link: what waits for a slow peer, and what goes to links of which role."""
