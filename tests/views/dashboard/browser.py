"""A headless Chromium, driven over the DevTools protocol: real pages, real clicks, real pictures."""

from __future__ import annotations

import base64
import contextlib
import io
import itertools
import json
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import PIL.Image
from websockets.sync.client import connect

CHROMIUM = shutil.which("chromium")
PATIENCE_S = 30.0
"""How long anything may take on a busy machine before a test gives up."""

_LAUNCH = (
    # Tests run as root, where Chromium's sandbox cannot.
    "--headless=new --no-sandbox --disable-gpu --hide-scrollbars --no-first-run --disable-extensions "
    "--disable-background-networking --disable-component-update --disable-sync --disable-default-apps "
    "--disable-background-timer-throttling --disable-renderer-backgrounding --disable-backgrounding-occluded-windows "
    "--force-device-scale-factor=1 --remote-debugging-port=0"
)


class Browser:
    """A Chromium with a profile of its own."""

    def __init__(self) -> None:
        assert CHROMIUM is not None
        self.directory = Path(tempfile.mkdtemp(prefix="hapticd-"))
        self.process = subprocess.Popen(
            [CHROMIUM, *_LAUNCH.split(), f"--user-data-dir={self.directory}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        port = self.directory / "DevToolsActivePort"
        end_s = time.monotonic() + PATIENCE_S
        while not (port.exists() and port.read_text().count("\n")):
            assert time.monotonic() < end_s, "Chromium does not come up"
            assert self.process.poll() is None, "Chromium has ended"
            time.sleep(0.02)
        number, path = port.read_text().split("\n")[:2]
        self._open = contextlib.ExitStack()
        # No pings: their thread draws from `random`, and Hypothesis blames the test that draws at that moment.
        self.socket = self._open.enter_context(
            connect(f"ws://127.0.0.1:{number}{path}", max_size=None, compression=None, ping_interval=None)
        )
        self.heard: list[dict[str, Any]] = []
        self._ids = itertools.count(1)

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()
        self.process.terminate()
        self.process.wait(PATIENCE_S)
        shutil.rmtree(self.directory, ignore_errors=True)

    def call(self, method: str, session: str | None = None, **params: Any) -> dict[str, Any]:
        """The answer to a command; events that come before it are kept in `heard`."""
        number = next(self._ids)
        message = {"id": number, "method": method, "params": params}
        self.socket.send(json.dumps(message if session is None else {**message, "sessionId": session}))
        while True:
            got = json.loads(self.socket.recv(PATIENCE_S))
            if got.get("id") == number:
                assert "error" not in got, (method, got["error"])
                result: dict[str, Any] = got["result"]
                return result
            self.heard.append(got)

    def page(self, url: str, width: int = 1366, height: int = 768, *, dark: bool = False) -> Page:
        """A tab with a page that has loaded."""
        context = self.call("Target.createBrowserContext")["browserContextId"]
        target = self.call("Target.createTarget", url="about:blank", browserContextId=context)["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        page = Page(self, target, session)
        for domain in ("Page", "Runtime", "Network", "Log"):
            page.call(f"{domain}.enable")
        page.resize(width, height)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        page.call("Emulation.setEmulatedMedia", features=[scheme])
        page.load("Page.navigate", url=url)
        return page

    def hear(self) -> None:
        """Wait for the next event; no command is under way."""
        self.heard.append(json.loads(self.socket.recv(PATIENCE_S)))


class Page:
    """One tab."""

    def __init__(self, browser: Browser, target: str, session: str) -> None:
        self.browser = browser
        self.target = target
        self.session = session

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self.browser.call("Target.closeTarget", targetId=self.target)

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        return self.browser.call(method, self.session, **params)

    def load(self, method: str, **params: Any) -> None:
        """Have the browser load a page; returns when the new one is there, of which the one before knows nothing."""
        loaded = len(self.events("Page.loadEventFired"))
        self.call(method, **params)
        while len(self._told("Page.loadEventFired")) == loaded:
            self.browser.hear()

    def evaluate(self, expression: str) -> Any:
        """The value of an expression, awaited when it is a promise."""
        answer = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def inside(self, expression: str) -> Any:
        """The value of an expression in which `page` is the page's own main module."""
        return self.evaluate(f"import('/main.js').then((page) => {expression})")

    def wait_for(self, expression: str) -> None:
        end_s = time.monotonic() + PATIENCE_S
        while not self.evaluate(expression):
            assert time.monotonic() < end_s, f"waited in vain for: {expression}; the page: {self.text()}"
            time.sleep(0.02)

    def wait_inside(self, expression: str) -> None:
        self.wait_for(f"import('/main.js').then((page) => {expression})")

    def click(self, selector: str) -> None:
        """Press what is at the middle of an element, as a finger would: what covers it is pressed instead."""
        x, y = self.evaluate(
            f"(() => {{ const box = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
            "return [box.x + box.width / 2, box.y + box.height / 2]; })()"
        )
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def type_into(self, selector: str, text: str) -> None:
        """Put a text into a field in the place of what is there."""
        self.evaluate(f"document.querySelector({json.dumps(selector)}).focus()")
        self.evaluate(f"document.querySelector({json.dumps(selector)}).select()")
        self.call("Input.insertText", text=text)

    def press_key(self, key: str) -> None:
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key)

    def resize(self, width: int, height: int) -> None:
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def text(self) -> str:
        return str(self.evaluate("document.body.innerText"))

    def png(self) -> bytes:
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def picture(self) -> npt.NDArray[np.uint8]:
        """What is seen: rows, columns, red green blue."""
        return np.asarray(PIL.Image.open(io.BytesIO(self.png())).convert("RGB"))

    def events(self, method: str) -> list[dict[str, Any]]:
        """What the browser has told of this tab under a name so far."""
        self.evaluate("0")  # what was on its way is heard before the answer
        return self._told(method)

    def _told(self, method: str) -> list[dict[str, Any]]:
        return [
            heard["params"]
            for heard in self.browser.heard
            if heard.get("method") == method and heard.get("sessionId") == self.session
        ]
