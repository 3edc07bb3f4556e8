"""What was entered, kept safe."""
