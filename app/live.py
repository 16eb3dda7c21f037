"""What live clients were answered last, by the ids that they gave: a minute long, one answer at a time, and half of one core."""

from __future__ import annotations

import asyncio
import time
from collections import OrderedDict
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

from app import problems

SECONDS = 60.0
"""For which a state is kept."""
MOST_BYTES = 2_000_000
MOST = 64
"""Ids of which a state is kept."""


class Kept:
    """What is kept of one id."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self.state = b""
        """Of the last answer, where the next begins; set by whoever computes."""
        self.at = 0.0
        self.free_at = 0.0
        """From then on the next may be computed."""
        self.newest = self.current = object()
        """Of its requests."""
        self.begun = 0.0
        self.turn = asyncio.Lock()

    def begin(self) -> None:
        """Said when its request is computed; raises `problems.Superseded` where there is a newer one."""
        if self.newest is not self.current:
            raise problems.Superseded
        self.begun = self._clock()


class Lives:
    """What is kept of all ids.

    Parameters
    ----------
    clock : callable
        Seconds of a monotonic clock.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._kept: OrderedDict[str, Kept] = OrderedDict()

    def __len__(self) -> int:
        self._forget()
        return len(self._kept)

    @asynccontextmanager
    async def turn(self, name: str | None) -> AsyncIterator[Kept]:
        """What is kept of an id, once its last request is answered; of none a state that nobody keeps.

        Of those that wait only the newest is computed: the others raise `problems.Superseded`. Between two answers as much time
        passes as the first took, so that one client has half a core at most.
        """
        if name is None:
            yield Kept(self._clock)
            return
        kept = self._of(name)
        mine = kept.newest = object()
        async with kept.turn:
            kept.current = mine
            if kept.newest is mine:
                await asyncio.sleep(max(0.0, kept.free_at - self._clock()))
            kept.begin()
            try:
                yield kept
            finally:
                kept.at = self._clock()
                kept.free_at = 2 * kept.at - kept.begun
                if len(kept.state) > MOST_BYTES:
                    kept.state = b""
                asyncio.get_running_loop().call_later(SECONDS, self._forget)

    def _of(self, name: str) -> Kept:
        self._forget()
        kept = self._kept.setdefault(name, Kept(self._clock))
        kept.at = self._clock()
        self._kept.move_to_end(name)
        while len(self._kept) > MOST:
            self._kept.popitem(last=False)
        return kept

    def _forget(self) -> None:
        """Drop what is older."""
        late = self._clock() - SECONDS
        for name in [name for name, kept in self._kept.items() if kept.at <= late and not kept.turn.locked()]:
            del self._kept[name]
