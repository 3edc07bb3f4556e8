"""Tables and JSON as text files, read with every bad place and written all or none."""
