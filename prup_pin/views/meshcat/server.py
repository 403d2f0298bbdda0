"""A small server for one page, on this machine only: browsers get the scene through a socket, and every new one."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from ...errors import InputError, MissingExtraError

#: Binary ones are meshcat's commands, texts are for the page itself.
Message = bytes | str

#: What the served page does first: it asks for the scene. Binary messages are meshcat's commands, the last one, a text,
#: is what the page shows besides.
START = """
const socket = new WebSocket(`ws://${location.host}/socket`);
socket.binaryType = "arraybuffer";
socket.onmessage = (message) => {
  if (typeof message.data === "string") show(JSON.parse(message.data));
  else viewer.handle_command_bytearray(new Uint8Array(message.data));
};
"""


class Session(Protocol):
    """What one browser sees, where browsers see different things."""

    def greeting(self) -> Sequence[Message]:
        """Return what is sent to the browser first."""

    def reply(self, message: str | bytes) -> Sequence[Message]:
        """Return what is sent for a message of the browser's."""


class Server:
    """Serves `page(host)` at 127.0.0.1, in a thread that ends with the program. `port` 0 takes a free one.

    All browsers see what `show` was told; with `session`, each has one of its own instead.
    """

    def __init__(self, page: Callable[[str], str], port: int = 0, session: Callable[[], Session] | None = None):
        try:
            import tornado.httpserver
            import tornado.web
            import tornado.websocket
        except ImportError as error:
            raise MissingExtraError("meshcat") from error
        server = self
        self._messages: list[Message] = []
        self._sockets: set[Any] = set()
        listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            listening.bind(("127.0.0.1", port))
            listening.listen(16)
            listening.setblocking(False)
        except (OSError, OverflowError) as error:
            listening.close()
            raise InputError(f"port {port} cannot be used ({error}); 0 takes a free one") from error
        self.port: int = listening.getsockname()[1]

        class Page(tornado.web.RequestHandler):
            def get(self) -> None:
                if not server._is_known(self.request.host):
                    self.set_status(403)
                    return
                self.set_header("Cache-Control", "no-store")
                self.write(page(self.request.host))

        class Socket(tornado.websocket.WebSocketHandler):
            def check_origin(self, origin: str) -> bool:
                return server._is_known(self.request.host) and super().check_origin(origin)

            own: Session | None = None

            def open(self, *_: str, **__: str) -> None:
                server._sockets.add(self)
                if session is not None:
                    self.own = session()
                server._send(self, server._messages if self.own is None else self.own.greeting())

            def on_message(self, message: str | bytes) -> None:
                if self.own is not None:
                    server._send(self, self.own.reply(message))

            def on_close(self) -> None:
                server._sockets.discard(self)

        ready = threading.Event()
        self._loop = asyncio.new_event_loop()

        def run() -> None:
            asyncio.set_event_loop(self._loop)
            pages = tornado.web.Application([(r"/", Page), (r"/socket", Socket)], log_function=lambda handler: None)
            http = tornado.httpserver.HTTPServer(pages)
            http.add_sockets([listening])
            self._loop.call_soon(ready.set)
            self._loop.run_forever()
            http.stop()
            for browser in list(self._sockets):
                browser.close()
            self._loop.run_until_complete(asyncio.sleep(0.05))
            self._loop.close()

        self._thread = threading.Thread(target=run, name="prup_pin view", daemon=True)
        self._thread.start()
        ready.wait(10)

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://127.0.0.1:{self.port}/"

    def show(self, messages: Sequence[Message], before: Sequence[bytes] = ()) -> None:
        """Send messages to all browsers, and to those that come later; `before` only to those that look already."""

        def send() -> None:
            self._messages = list(messages)
            for browser in list(self._sockets):
                self._send(browser, [*before, *messages])

        self._loop.call_soon_threadsafe(send)

    def _is_known(self, host: str) -> bool:
        """Return False for names other than this machine's, by which a foreign site could reach the page."""
        return host in (f"127.0.0.1:{self.port}", f"localhost:{self.port}")

    @staticmethod
    def _send(browser: Any, messages: Sequence[Message]) -> None:
        for message in messages:
            browser.write_message(message, binary=isinstance(message, bytes))

    def wait(self) -> None:
        """Wait until the server is stopped; Ctrl-C ends the waiting."""
        while self._thread.is_alive():
            self._thread.join(0.5)

    def stop(self) -> None:
        """Stop serving."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(5)


class Served:
    """What may be looked at through a server of its own."""

    def __init__(self) -> None:
        self._server: Server | None = None

    @property
    def url(self) -> str | None:
        """Address of the server, or None where none runs."""
        return None if self._server is None else self._server.url

    def wait(self) -> None:
        """Wait while it is served, until `close` or Ctrl-C."""
        if self._server is not None:
            self._server.wait()

    def close(self) -> None:
        """Stop the server, if one runs."""
        if self._server is not None:
            self._server.stop()
            self._server = None
