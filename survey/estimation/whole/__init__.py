"""Networks whose marks and stops can only be located together."""
