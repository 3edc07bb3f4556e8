"""How the errors of a table's poses follow those of another table."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array


@dataclass(frozen=True)
class Follows:
    """Errors taken over from another table through a few unknowns: a frame, a mount.

    The frame of a system that was placed by surveyed stops errs as the survey of these stops
    does. To first order the errors taken over are ``by @ of`` times the errors of the other
    table's poses at ``ids``; what a pose errs besides is independent of that table.

    Parameters
    ----------
    system : str
        The other table: 'survey'.
    ids : tuple of str
        Its m stops that were used.
    by : (n k, r) array
        How the n poses follow the r unknowns.
    of : (r, m k) array
        How the unknowns follow the other table's numbers at these stops.
    what : str
        The unknowns, in words: 'frame', 'frame and mount'.
    """

    system: str
    ids: tuple[str, ...]
    by: Array
    of: Array
    what: str = "frame"

    @property
    def gain(self) -> Array:
        """(n k, m k) how the poses follow the other table's numbers."""
        return np.asarray(self.by @ self.of)

    def rows(self, flat: npt.NDArray[np.intp]) -> "Follows":
        """The same for some of the poses' numbers."""
        return replace(self, by=self.by[flat])
