"""The page, and a small server for it, on this machine only: browsers get the scene through a socket."""

from __future__ import annotations

import asyncio
import html
import importlib.util
import re
import socket
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...errors import InputError

#: Binary ones are meshcat's commands, a text is JSON of what the page shows beside them; live.js reads both.
Message = bytes | str


def viewer_script() -> str:
    """Return meshcat's viewer, without loading meshcat."""
    spec = importlib.util.find_spec("meshcat")
    assert spec is not None
    assert spec.origin is not None
    return (Path(spec.origin).parent / "viewer" / "dist" / "main.min.js").read_text(encoding="utf-8")


def page_html(title: str, start: str, connect: str = "'none'") -> str:
    """Return the page; `connect` is what its content security policy lets it connect to."""
    fields = {"TITLE": html.escape(title), "MESHCAT": viewer_script(), "START": start, "CONNECT": connect}
    template = (Path(__file__).parent / "page.html").read_text(encoding="utf-8")
    return re.sub("__([A-Z]+)__", lambda match: fields[match[1]], template)


class Served:
    """What may be looked at through a server of its own: it has a title, and a session for every browser.

    The server runs in a thread that ends with the program.
    """

    title: str
    #: Address of the page, or None where nothing serves it.
    url: str | None = None

    def session(self) -> Any:
        """Return what a new browser sees: its `greeting()` is sent first, its `reply(message)` for each message."""
        raise NotImplementedError

    def serve(self, port: int = 0) -> str:
        """Serve it to browsers on this machine (127.0.0.1) and return the address; 0 takes a free port.

        Raises InputError where the port is taken.
        """
        if self.url is None:
            self._start(port)
        assert self.url is not None
        return self.url

    def wait(self) -> None:
        """Wait while it is served, until `close` or Ctrl-C."""
        while self.url is not None and self._thread.is_alive():
            self._thread.join(0.5)

    def close(self) -> None:
        """Stop the server, if one runs."""
        if self.url is not None:
            self.url = None
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(5)

    def _start(self, port: int) -> None:
        import tornado.httpserver  # heavy; comes with meshcat
        import tornado.web
        import tornado.websocket

        listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            listening.bind(("127.0.0.1", port))
            listening.listen(16)
            listening.setblocking(False)
        except (OSError, OverflowError) as error:
            listening.close()
            raise InputError(f"port {port} cannot be used ({error}); 0 takes a free one") from error
        port = listening.getsockname()[1]
        # by other names of this machine a foreign site could reach the page
        hosts = (f"127.0.0.1:{port}", f"localhost:{port}")
        title, script = self.title, (Path(__file__).parent / "live.js").read_text(encoding="utf-8")
        sockets: set[Any] = set()
        self._sockets, session = sockets, self.session

        class Page(tornado.web.RequestHandler):
            def get(self) -> None:
                if self.request.host not in hosts:
                    self.set_status(403)
                    return
                self.set_header("Cache-Control", "no-store")
                self.write(page_html(title, script, f"ws://{self.request.host}"))

        class Socket(tornado.websocket.WebSocketHandler):
            def check_origin(self, origin: str) -> bool:
                return self.request.host in hosts and super().check_origin(origin)

            def open(self, *_: str, **__: str) -> None:
                sockets.add(self)
                self.own = session()
                _send(self, self.own.greeting())

            def on_message(self, message: str | bytes) -> None:
                _send(self, self.own.reply(message))

            def on_close(self) -> None:
                sockets.discard(self)

        ready = threading.Event()
        loop = self._loop = asyncio.new_event_loop()

        def run() -> None:
            asyncio.set_event_loop(loop)
            pages = tornado.web.Application([(r"/", Page), (r"/socket", Socket)], log_function=lambda handler: None)
            http = tornado.httpserver.HTTPServer(pages)
            http.add_sockets([listening])
            loop.call_soon(ready.set)
            loop.run_forever()
            http.stop()
            for browser in list(sockets):
                browser.close()
            loop.run_until_complete(asyncio.sleep(0.05))
            loop.close()

        self._thread = threading.Thread(target=run, name="prup_pin view", daemon=True)
        self._thread.start()
        ready.wait(10)
        self.url = f"http://127.0.0.1:{port}/"

    def tell(self, messages: Sequence[Message]) -> None:
        """Send messages to all browsers that look at it."""

        def send() -> None:
            for browser in list(self._sockets):
                _send(browser, messages)

        if self.url is not None:
            self._loop.call_soon_threadsafe(send)


def _send(browser: Any, messages: Sequence[Message]) -> None:
    for message in messages:
        browser.write_message(message, binary=isinstance(message, bytes))
