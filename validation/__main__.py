"""``python -m validation`` is ``gtval``."""

from validation.cli import main

main(prog_name="gtval")
