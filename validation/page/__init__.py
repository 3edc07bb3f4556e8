"""The page in the browser: access, serving, panels found by entry points."""
