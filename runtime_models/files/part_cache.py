"""Decoded parts of files: those used last, within a bound of bytes."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, Protocol, TypeVar


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
        self.decoded = 0  # how often a part was made
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

    def _keep(self, key: Hashable, part: P) -> None:
        with self._lock:
            self.decoded += 1
            gone = []
            while self._parts and self.taken + part.size > self.most:
                _, old = self._parts.popitem(last=False)
                self.taken -= old.size
                gone.append(old)
            if part.size <= self.most:
                self._parts[key] = part
                self.taken += part.size
            else:
                gone.append(part)
        for old in gone:
            old.release()
