"""Decoded parts of files: those used last, within a bound of bytes."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, Protocol, TypeVar

LEAST = 64 << 20  # bytes that are never lent


class CachedPart(Protocol):
    """What is kept."""

    size: int  # bytes

    def release(self) -> None:
        """Called once nobody will be given it any more."""


P = TypeVar("P", bound=CachedPart)


class PartCache(Generic[P]):
    """Parts by key; the one used longest ago goes first.  For any thread.

    A part that is larger than the bound is given, but not kept.
    """

    def __init__(self, most: int) -> None:
        self.most, self.taken = most, 0  # bytes
        self._lent = 0  # of them, to others
        self.decoded = 0  # how often a part was made
        self.version = 0  # rises whenever other parts are kept
        self._parts: OrderedDict[Hashable, P] = OrderedDict()
        self._lock = threading.Lock()
        self._making: dict[Hashable, threading.Lock] = {}

    def __contains__(self, key: Hashable) -> bool:
        return key in self._parts

    def get(self, key: Hashable, make: Callable[[], P]) -> P:
        """The part of that key; made where it is not here, once however many threads ask.

        Raises what `make` raises, and then keeps nothing.
        """
        with self._lock:
            if (part := self._parts.get(key)) is not None:
                self._parts.move_to_end(key)
                return part
            making = self._making.setdefault(key, threading.Lock())
        with making:
            with self._lock:
                if (part := self._parts.get(key)) is not None:
                    return part
            try:
                part = make()
            finally:
                with self._lock:
                    self._making.pop(key, None)
            self._keep(key, part)
            return part

    def lend(self, size: int) -> None:
        """Others have so many bytes of the bound: what was used longest ago goes for them, until
        LEAST are left.
        """
        with self._lock:
            self._lent = size
            gone = self._make_room(0)
        for old in gone:
            old.release()

    def _make_room(self, size: int) -> list[P]:
        """Takes out what has to go for so many more bytes."""
        most, gone = max(self.most - self._lent, min(self.most, LEAST)), []
        while self._parts and self.taken + size > most:
            _, old = self._parts.popitem(last=False)
            self.taken -= old.size
            self.version += 1
            gone.append(old)
        return gone

    def _keep(self, key: Hashable, part: P) -> None:
        with self._lock:
            self.decoded += 1
            gone = self._make_room(part.size)
            if part.size <= self.most:
                self._parts[key] = part
                self.taken += part.size
                self.version += 1
            else:
                gone.append(part)
        for old in gone:
            old.release()
