"""What the images allow where they do not give poses of the robot in the Vframe."""
