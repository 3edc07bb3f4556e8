"""Large sparse normal equations."""
