"""Requests that were done already."""


class Heard:
    """Requests that have been done, by the names that the page gave them.

    A browser that died may send again what it had an answer to: its storage lags behind. Names are
    kept as long as the process lives; what counts already is recognised without them.

    Parameters
    ----------
    most : int
        Names kept, the newest.
    """

    def __init__(self, most: int = 10_000) -> None:
        self._names: dict[str, None] = {}
        self._most = most

    def __contains__(self, name: str) -> bool:
        return name in self._names

    def add(self, name: str) -> None:
        """Keep the name of a request that has been done; '' is none."""
        if name:
            self._names[name] = None
        while len(self._names) > self._most:
            del self._names[next(iter(self._names))]
