"""Who may connect to the bridge: connections taken from the socket, bounded by address, judged before they are one."""
