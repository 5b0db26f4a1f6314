"""Keeps the scene framed: once the free part of the window has another size, it is fitted anew."""

from collections.abc import Callable

Size = tuple[int, int]
SETTLED_S = 0.15  # without a change: fitting asks every splat where it is


class Framed:
    """Waits until a size has settled; whether to fit at all is `refit`'s to know."""

    def __init__(self, size: Callable[[], Size], refit: Callable[[Size], None]) -> None:
        self._size, self._refit = size, refit
        self._fitted = self._last = size()
        self._since = 0.0

    def poll(self, now: float) -> bool:
        """Once a frame; True while a size has yet to settle.  Seconds of any clock."""
        size = self._size()
        if size != self._last:
            self._last, self._since = size, now
        if size != self._fitted and now - self._since >= SETTLED_S:
            self._fitted = size
            self._refit(size)
        return size != self._fitted

    def forget(self) -> None:
        """Another scene was framed in the window as it is now."""
        self._fitted = self._last = self._size()
