"""What goes wrong: devices' faults and people's mistakes."""
