"""Who may do what: tokens, invitations, and how both end."""
