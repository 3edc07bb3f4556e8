"""A campaign folder: campaign.toml, what lies beside it, and what is already computed."""
