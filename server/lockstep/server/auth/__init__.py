"""Access control: tokens, invitations, and their expiry and revocation."""
