"""The text of a Result, packed part by part in a thread while the next stages are computed."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Any

from isal import isal_zlib

from hexwrap_server.http.answers import GZIP_LEVEL, GZIP_WINDOW
from hexwrap_server.jobs.parts import Places


class Packer:
    """Takes the parts of a JSON object in turn. places: where each stands in the unpacked text."""

    def __init__(self, dump: Callable[[Any], bytes]) -> None:
        self._dump = dump
        self.places: Places = {}
        self._names: list[str] = []
        self._begun: list[str] = []
        self._position = 0
        self._gzip: Any = isal_zlib.compressobj(GZIP_LEVEL, wbits=GZIP_WINDOW)
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="hexwrap-packer")
        self._packed: list[Future[bytes]] = []

    def __enter__(self) -> Packer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._thread.shutdown(cancel_futures=True)

    def __contains__(self, name: str) -> bool:
        return name in self._names

    def has_begun(self, name: str) -> bool:
        return name in self._begun

    def foresee(self, make: Callable[[], Any]) -> Callable[[], bytes]:
        """The text of a part that will probably be added; ask for it when it is."""
        return self._thread.submit(lambda: self._dump(make())).result

    def begin(self, name: str, make: Callable[[], Any]) -> None:
        """make: leads to the first members of an object; whoever adds the part gives the others."""
        self._begun.append(name)
        self._packed.append(self._thread.submit(self._pack, name, lambda: self._dump(make())[:-1]))

    def add(self, name: str, make: Callable[[], Any]) -> None:
        """make: leads to the part as dump takes it; called in the thread."""
        self.add_text(name, lambda: self._dump(make()))

    def add_text(self, name: str, make: Callable[[], bytes]) -> None:
        """make: leads to the text of the part; called in the thread."""
        self._names.append(name)
        self._packed.append(self._thread.submit(self._pack, name, make))

    def finish(self) -> bytes:
        """The whole object, packed. Raises what a ``make`` raised."""
        self._packed.append(self._thread.submit(lambda: self._gzip.compress(b"}") + self._gzip.flush()))
        return b"".join(piece.result() for piece in self._packed)

    def _pack(self, name: str, make: Callable[[], bytes]) -> bytes:
        text = make()
        if name in self.places:  # begun: a comma for the brace that opens the other members
            head, text = b",", text[1:]
            start = self.places[name][0]
        else:
            head = b'%s"%s":' % (b"," if self.places else b"{", name.encode())
            start = self._position + len(head)
        self._position += len(head) + len(text)
        self.places[name] = (start, self._position)
        packed: bytes = self._gzip.compress(head) + self._gzip.compress(text)
        return packed
