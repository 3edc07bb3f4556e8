"""Front door of gtval and what all systems share: poses, campaigns, statistics, reports."""
