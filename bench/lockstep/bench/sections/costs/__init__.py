"""What a part costs a process, a machine or the operator."""
