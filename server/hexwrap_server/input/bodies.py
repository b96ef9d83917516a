"""The body of a request as it was sent, and unpacked under a limit."""

from __future__ import annotations

import gzip
import io
import zlib
from dataclasses import dataclass

from hexwrap_server.errors import HttpError, refusal


@dataclass(frozen=True)
class Body:
    """encoding: empty, or ``gzip``."""

    data: bytes
    encoding: str = ""

    def plain(self, max_mib: float) -> bytes:
        """The body, unpacked no further than the limit. Raises HttpError."""
        if not self.encoding:
            return self.data
        limit = int(max_mib * 2**20)
        try:
            with gzip.open(io.BytesIO(self.data)) as file:
                whole = file.read(limit + 1)
        except (OSError, EOFError, zlib.error):
            raise refusal(
                "not-gzip", "Content-Encoding says gzip, but the body is damaged or truncated."
            ) from None
        if len(whole) > limit:
            raise body_too_large(max_mib)
        return whole


def body_too_large(max_mib: float) -> HttpError:
    return refusal(
        "body-too-large",
        f"The body has more than {max_mib:g} MiB, the limit of this server (unpacked, where it is gzip); "
        "send a coarser mesh, or start the server with a larger --max-body-mib.",
        {"Connection": "close"},
    )
