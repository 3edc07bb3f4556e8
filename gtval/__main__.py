"""``python -m gtval`` is the command ``gtval``."""

from validation.cli import main

main(prog_name="gtval")
