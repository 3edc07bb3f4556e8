"""Connections that wait for nobody: one that sends no request is closed."""

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

MAX_SECONDS = 10.0
"""For the head of a request to come in whole."""


class PromptConnection(H11Protocol):
    """An HTTP connection that is closed where the head of a request does not come in time.

    uvicorn itself waits for ever, so that a few hundred silent connections of one stranger would
    keep everybody else out.
    """

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for the first request."""
        super().connection_made(transport)
        self._waiting = self.loop.call_later(MAX_SECONDS, self._give_up)

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait no longer."""
        self._waiting.cancel()
        super().connection_lost(exc)

    def on_response_complete(self) -> None:
        """Begin to wait for the next request."""
        super().on_response_complete()
        self._waiting.cancel()
        self._waiting = self.loop.call_later(MAX_SECONDS, self._give_up)

    def _give_up(self) -> None:
        """Close, unless a request is being served."""
        served: Any = self.cycle
        if served is None or served.response_complete:
            self.transport.close()
