"""The commands about links, invitations, the audit, and robots that dial in."""
