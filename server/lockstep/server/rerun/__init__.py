"""The session live to Rerun: to a viewer, to those who connect, or into a file."""
