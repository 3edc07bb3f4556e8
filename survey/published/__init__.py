"""The document's own listings, as printed."""
