"""Connections of a cluster of this machine: each begins with a word that the driver has chosen.

A port of dask runs what it is sent, and every user of the machine can reach it.
"""

from __future__ import annotations

import os
import secrets
from contextlib import suppress
from hmac import compare_digest
from typing import Any

from distributed.comm.registry import backends
from distributed.comm.tcp import TCPBackend, TCPConnector, TCPListener
from tornado.iostream import IOStream, StreamClosedError

# Where workers find the word, and what addresses begin with.
VARIABLE, PROTOCOL = "VEHICLEMOR_WORD", "vehiclemor"
WORD = os.environ.get(VARIABLE) or secrets.token_hex()


class _Connector(TCPConnector):
    prefix = f"{PROTOCOL}://"

    async def connect(self, *arguments: Any, **options: Any) -> Any:
        connection = await super().connect(*arguments, **options)
        await connection.stream.write(WORD.encode())
        return connection


class _Listener(TCPListener):
    prefix = f"{PROTOCOL}://"

    async def _prepare_stream(self, stream: IOStream, address: str) -> IOStream | None:  # noqa: ARG002
        """The stream, before anything of it is unpacked; none if it begins with another word."""
        with suppress(StreamClosedError):
            if compare_digest(await stream.read_bytes(len(WORD)), WORD.encode()):
                return stream
        stream.close()
        return None


class _Backend(TCPBackend):
    _connector_class, _listener_class = _Connector, _Listener


backends[PROTOCOL] = _Backend()
