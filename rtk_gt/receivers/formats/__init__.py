"""Files of receivers, each kind with its reader."""
