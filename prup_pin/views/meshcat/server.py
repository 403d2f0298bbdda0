"""The page, and a small server for it, on this machine only: browsers get the scene through a socket."""

from __future__ import annotations

import asyncio
import html
import importlib.util
import re
import socket
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

from ...errors import InputError, MissingExtraError

#: Binary ones are meshcat's commands, a text is JSON of what the page shows beside them; live.js reads both.
Message = bytes | str


def viewer_script() -> str:
    """Return meshcat's viewer. Raises MissingExtraError."""
    spec = importlib.util.find_spec("meshcat")
    for folder in (spec.submodule_search_locations or ()) if spec is not None else ():
        path = Path(folder) / "viewer" / "dist" / "main.min.js"
        if path.is_file():
            return path.read_text(encoding="utf-8")
    raise MissingExtraError("meshcat")


def page_html(title: str, start: str, connect: str = "'none'") -> str:
    """Return the page; `connect` is what its content security policy lets it connect to."""
    fields = {"TITLE": html.escape(title), "MESHCAT": viewer_script(), "START": start, "CONNECT": connect}
    template = (Path(__file__).parent / "page.html").read_text(encoding="utf-8")
    return re.sub("__([A-Z]+)__", lambda match: fields[match[1]], template)


class Session(Protocol):
    """What one browser sees."""

    def greeting(self) -> Sequence[Message]:
        """Return what is sent to the browser first."""

    def reply(self, message: str | bytes) -> Sequence[Message]:
        """Return what is sent for a message of the browser's."""


class Server:
    """Serves a page at 127.0.0.1, in a thread that ends with the program. `port` 0 takes a free one.

    Every browser has what `session` returns for it.
    """

    def __init__(self, title: str, port: int, session: Callable[[], Session]):
        try:
            import tornado.httpserver
            import tornado.web
            import tornado.websocket
        except ImportError as error:
            raise MissingExtraError("meshcat") from error
        server = self
        script = (Path(__file__).parent / "live.js").read_text(encoding="utf-8")
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
                self.write(page_html(title, script, f"ws://{self.request.host}"))

        class Socket(tornado.websocket.WebSocketHandler):
            def check_origin(self, origin: str) -> bool:
                return server._is_known(self.request.host) and super().check_origin(origin)

            def open(self, *_: str, **__: str) -> None:
                server._sockets.add(self)
                self.own = session()
                server._send(self, self.own.greeting())

            def on_message(self, message: str | bytes) -> None:
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

    def tell(self, messages: Sequence[Message]) -> None:
        """Send messages to all browsers."""

        def send() -> None:
            for browser in list(self._sockets):
                self._send(browser, messages)

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
    """What may be looked at through a server of its own: it has a title, and a session for every browser."""

    title: str
    _server: Server | None = None

    def session(self) -> Session:
        """Return what a new browser sees."""
        raise NotImplementedError

    def serve(self, port: int = 0) -> str:
        """Serve it to browsers on this machine (127.0.0.1) and return the address; 0 takes a free port.

        Raises InputError where the port is taken, MissingExtraError.
        """
        if self._server is None:
            self._server = Server(self.title, port, self.session)
        return self._server.url

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
