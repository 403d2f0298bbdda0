"""The page, and a small server for it, on this machine only."""

from __future__ import annotations

import base64
import gzip
import html
import importlib.util
import json
import re
import sys
from pathlib import Path
from threading import Lock, Thread
from typing import Any

from ...errors import InputError


def page_html(title: str, first: dict[str, Any], live: bool = False) -> str:
    """Return the page that shows a first message (`View.message`); a live one may ask its server for more."""
    spec = importlib.util.find_spec("meshcat")  # whose viewer is read without loading meshcat
    assert spec is not None
    assert spec.origin is not None
    here = Path(__file__).parent
    packed = gzip.compress(json.dumps(first, allow_nan=False).encode(), 6, mtime=0)
    fields = {
        "TITLE": html.escape(title),
        "MESHCAT": (Path(spec.origin).parent / "viewer" / "dist" / "main.min.js").read_text(encoding="utf-8"),
        "LIVE": (here / "live.js").read_text(encoding="utf-8") if live else "",
        "FIRST": base64.b64encode(packed).decode("ascii"),
        "CONNECT": "'self'" if live else "'none'",
    }
    return re.sub("__([A-Z]+)__", lambda match: fields[match[1]], (here / "page.html").read_text(encoding="utf-8"))


class Served:
    """What may be looked at through a server of its own, in a thread that ends with the program."""

    title: str
    #: Address of the page, or None where nothing serves it.
    url: str | None = None

    def message(self) -> dict[str, Any]:
        """Return what a new page shows."""
        raise NotImplementedError

    def reply(self, question: bytes) -> dict[str, Any]:
        """Return the answer to what a page asks, nothing where nothing is new to it."""
        raise NotImplementedError

    def serve(self, port: int = 0) -> str:
        """Serve it to browsers on this machine (127.0.0.1) and return the address; 0 takes a free port.

        Raises InputError where the port is taken.
        """
        from http.server import BaseHTTPRequestHandler
        from socketserver import ThreadingTCPServer

        if self.url is not None:
            return self.url
        shown, one_by_one = self, Lock()

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self._answer(lambda: page_html(shown.title, shown.message(), live=True), "text/html; charset=utf-8")

            def do_POST(self) -> None:
                question = self.rfile.read(int(self.headers.get("Content-Length", 0)))
                self._answer(lambda: json.dumps(shown.reply(question), allow_nan=False), "application/json")

            def _answer(self, make, kind: str) -> None:
                own = (f"127.0.0.1:{port}", f"localhost:{port}")
                # by other names of this machine, and from pages of its own, a foreign site could reach the page
                asked_by = self.headers.get("Origin", f"http://{own[0]}").removeprefix("http://")
                allowed = self.headers.get("Host") in own and asked_by in own
                if not allowed or self.path != "/":
                    self.send_error(404 if allowed else 403)
                    return
                with one_by_one:
                    content = make().encode()
                self.send_response(200)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(content)))
                self.send_header("Cache-Control", "no-store")
                self.end_headers()
                self.wfile.write(content)

            def log_message(self, *_: Any) -> None:
                pass

        class Server(ThreadingTCPServer):
            daemon_threads = True

            def handle_error(self, request: Any, client_address: Any) -> None:
                if not isinstance(sys.exc_info()[1], ConnectionError):  # a browser that leaves is no error
                    super().handle_error(request, client_address)

        try:
            self._server = Server(("127.0.0.1", port), Handler)
        except (OSError, OverflowError) as error:
            raise InputError(f"port {port} cannot be used ({error}); 0 takes a free one") from error
        port = self._server.server_address[1]
        self._thread = Thread(target=self._server.serve_forever, name="prup_pin view", daemon=True)
        self._thread.start()
        self.url = f"http://127.0.0.1:{port}/"
        return self.url

    def wait(self) -> None:
        """Wait while it is served, until `close` or Ctrl-C."""
        while self.url is not None and self._thread.is_alive():
            self._thread.join(0.5)

    def close(self) -> None:
        """Stop the server, if one runs."""
        if self.url is not None:
            self.url = None
            self._server.shutdown()
            self._server.server_close()
