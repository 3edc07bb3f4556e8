"""The panel of the page on which matches are looked at and decided on."""
