"""A session in Rerun's terms, with the event references as a timeline; for files and for live viewers."""
