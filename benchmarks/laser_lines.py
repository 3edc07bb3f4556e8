"""Figures of laser GT beside what is asked of them, one a line."""

import argparse
from dataclasses import dataclass, field


@dataclass
class Lines:
    """Prints each figure as it is known, and remembers whether all were met.

    Parameters
    ----------
    missed : list of str
        What was not met.
    """

    missed: list[str] = field(default_factory=list)

    def show(self, what: str, figure: str, asked: str, *, met: bool) -> None:
        """One line: what, the figure, what is asked, and whether it is met."""
        print(f"{what:<58} {figure:>22}   asked: {asked:<22} {'met' if met else 'MISSED'}")
        if not met:
            self.missed.append(what)

    def at_most(self, what: str, figure: float, limit: float, unit: str) -> None:
        """A figure with an upper limit."""
        self.show(what, f"{figure:.2f} {unit}", f"<= {limit:g} {unit}", met=figure <= limit)

    def share(self, what: str, count: int, total: int, least: float) -> None:
        """A share of cases with a lower limit."""
        figure = f"{count} of {total} ({count / total:.1%})"
        self.show(what, figure, f">= {least:.0%}", met=count >= least * total)


def arguments(description: str | None, seed: int, **counts: int) -> argparse.Namespace:
    """The command line: ``--seed`` and the number of cases of each kind."""
    parser = argparse.ArgumentParser(description=(description or "").splitlines()[0])
    parser.add_argument("--seed", type=int, default=seed, help="first seed of all chance")
    for name, count in counts.items():
        parser.add_argument(f"--{name}", type=int, default=count, help=f"default {count}")
    return parser.parse_args()
