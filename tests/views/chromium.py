"""A real headless Chromium, driven through its DevTools protocol: opens a page, runs scripts in it, takes pictures."""

import asyncio
import base64
import importlib.util
import io
import json
import subprocess
import time
import urllib.request
from contextlib import contextmanager
from pathlib import Path

import numpy as np

SPEC = importlib.util.spec_from_file_location("render", Path(__file__).parents[2] / "scripts" / "render.py")
render = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(render)


#: No test asks how fast anything is: this long a machine that does other work may take for any step [s].
PATIENCE = 600
#: Pixels drawn for each that the page is laid out in: fewer are drawn sooner.
SCALE = 0.5
#: Shadows say nothing that tests ask, and software takes longer to draw them than all the rest.
NO_SHADOWS = "viewer.scene.traverse(item => { if (item.isLight) item.castShadow = false; })"
DOMAINS = ("Page", "Network", "Runtime", "Log")
#: A promise that is kept when what is due has been drawn.
DRAWN = (
    "new Promise(done => { let left = 2; const step = () => left-- ? requestAnimationFrame(step) : done(true); "
    "step(); })"
)


class Browser:
    """One tab. `requests` holds every address that the page asked for."""

    def __init__(self, folder, size=(1000, 700)):
        self._begin(size)
        self._process = subprocess.Popen(
            [
                *render.command(render.find_chromium(), folder, size),
                "--remote-debugging-port=0",
                f"--force-device-scale-factor={SCALE}",
                # names of other hosts lead nowhere, so that a page that needs the network shows itself
                "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
                "about:blank",
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        port = Path(folder) / "DevToolsActivePort"
        self._until(lambda: port.is_file() and len(port.read_text().split()) > 1, "Chromium did not start")
        self._port = port.read_text().split()[0]
        with urllib.request.urlopen(f"http://127.0.0.1:{self._port}/json/list", timeout=PATIENCE) as answer:
            tab = next(target for target in json.load(answer) if target["type"] == "page")
        self._connect(f"page/{tab['id']}")
        for domain in DOMAINS:
            self.call(f"{domain}.enable")

    def _begin(self, size):
        self.size, self.requests, self.errors, self._answers, self._count = size, [], [], {}, 0
        self._loop = asyncio.new_event_loop()

    def _connect(self, target):
        from tornado.websocket import websocket_connect

        async def connected():
            address = f"ws://127.0.0.1:{self._port}/devtools/{target}"
            return await websocket_connect(address, max_message_size=100_000_000)

        self._socket = self._run(connected())

    def _other(self, kind, size, target):
        """Return an object for something else in the same process."""
        other = object.__new__(kind)
        other._port = self._port
        other._begin(size)
        other._connect(target)
        return other

    @contextmanager
    def tab(self, kind=None, size=None):
        """Open a tab that shares nothing with others but the process; it is of this class or another kind of it."""
        width, height = size or self.size
        with urllib.request.urlopen(f"http://127.0.0.1:{self._port}/json/version", timeout=PATIENCE) as answer:
            target = json.load(answer)["webSocketDebuggerUrl"].partition("/devtools/")[2]
        whole = self._other(Browser, self.size, target)
        context = whole.call("Target.createBrowserContext")["browserContextId"]
        options = {"browserContextId": context, "width": width, "height": height}
        made = whole.call("Target.createTarget", url="about:blank", **options)["targetId"]
        tab = self._other(kind or type(self), (width, height), f"page/{made}")
        try:
            for domain in DOMAINS:
                tab.call(f"{domain}.enable")
            yield tab
        finally:
            whole.call("Target.disposeBrowserContext", browserContextId=context)
            for each in (tab, whole):
                each._socket.close()
                each._loop.close()

    def _until(self, condition, message):
        end = time.monotonic() + PATIENCE
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError(message)
            time.sleep(0.05)

    def _run(self, coroutine):
        return self._loop.run_until_complete(asyncio.wait_for(coroutine, PATIENCE))

    async def _receive(self, number):
        while number not in self._answers:
            message = json.loads(await self._socket.read_message())
            if "id" in message:
                self._answers[message["id"]] = message
            elif message["method"] == "Network.requestWillBeSent":
                self.requests.append(message["params"]["request"]["url"])
            elif message["method"] == "Network.webSocketCreated":
                self.requests.append(message["params"]["url"])
            elif message["method"] == "Runtime.exceptionThrown":
                self.errors.append(str(message["params"]["exceptionDetails"])[:500])
            elif message["method"] == "Log.entryAdded" and message["params"]["entry"]["level"] == "error":
                self.errors.append(message["params"]["entry"]["text"])
        return self._answers.pop(number)

    def call(self, method, **params):
        self._count += 1
        number = self._count

        async def ask():
            await self._socket.write_message(json.dumps({"id": number, "method": method, "params": params}))
            return await self._receive(number)

        answer = self._run(ask())
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        return answer["result"]

    def evaluate(self, script):
        result = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            raise RuntimeError(f"{script}: {result['exceptionDetails']}")
        return result["result"].get("value")

    def settle(self):
        """Wait until one more picture has been drawn."""
        self.evaluate(f"viewer.set_dirty(); {DRAWN}")

    def open(self, address):
        self.requests.clear()
        self.errors.clear()
        self.call("Page.navigate", url=address)
        self._until(
            lambda: self.evaluate("typeof page !== 'undefined' && page !== null && document.readyState === 'complete'"),
            f"{address} shows nothing; {self.errors}",
        )
        self.evaluate(NO_SHADOWS)
        self.settle()

    def picture(self):
        """Return what is seen once it has been drawn, as `screenshot`."""
        self.settle()
        return self.screenshot()

    def screenshot(self):
        """Return what is seen, (height, width, 3), with SCALE pixels for each of the page's."""
        from PIL import Image

        data = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)

    def show(self, path, visible):
        self.evaluate(
            f"viewer.set_property({json.dumps(path.split('/'))}, 'visible', {str(visible).lower()}); viewer.set_dirty()"
        )

    def close(self):
        try:
            self.call("Browser.close")
        except Exception:
            self._process.terminate()
        self._process.wait(PATIENCE)
        self._loop.close()


def area(seen):
    """Return how many of the page's pixels a mask of a picture covers."""
    return np.count_nonzero(seen) / SCALE**2
