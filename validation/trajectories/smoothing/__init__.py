"""Several sources of poses with delays into one trajectory with covariances."""
