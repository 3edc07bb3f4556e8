"""The stages of a campaign before the robot: its images, lenses, network, places of markers."""
