"""The panel of the page on which images are looked at and decided on."""
