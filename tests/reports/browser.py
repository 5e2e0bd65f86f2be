"""A headless Chromium, driven over its DevTools pipe: null-terminated JSON on the child's file descriptors 3 and 4."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

from waiting import PATIENCE

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
# The child's descriptors must be 3 and 4; a program of its own moves them, as a fork of this process could deadlock.
_LAUNCH = """
import fcntl, os, sys
commands, events = (fcntl.fcntl(int(fd), fcntl.F_DUPFD, 10) for fd in sys.argv[1:3])
os.dup2(commands, 3)
os.dup2(events, 4)
os.execv(sys.argv[3], sys.argv[3:])
"""
_KEYS = {" ": (32, "Space", " "), "ArrowRight": (39, "ArrowRight", ""), "ArrowLeft": (37, "ArrowLeft", "")}
_KEYS |= {"ArrowUp": (38, "ArrowUp", ""), "ArrowDown": (40, "ArrowDown", "")}
_KEYS |= {"+": (187, "Equal", "+"), "-": (189, "Minus", "-"), "0": (48, "Digit0", "0")}
_KEYS |= {"Home": (36, "Home", ""), "End": (35, "End", ""), "Tab": (9, "Tab", "")}


def chromium() -> str | None:
    """Path of a Chromium or Chrome; None where there is none."""
    return next(filter(None, map(shutil.which, NAMES)), None)


class Browser:
    """A running browser; a context manager."""

    def __init__(self, program: str) -> None:
        self._profile = tempfile.TemporaryDirectory(prefix="vedette-browser-", ignore_cleanup_errors=True)
        commands, self._commands = os.pipe()
        self._events, events = os.pipe()
        flags = ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"]
        flags += ["--remote-debugging-pipe", f"--user-data-dir={self._profile.name}", "--hide-scrollbars"]
        self._process = subprocess.Popen(
            [sys.executable, "-c", _LAUNCH, str(commands), str(events), program, *flags],
            pass_fds=(commands, events),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(commands)
        os.close(events)
        self._unread = b""
        self._last = 0
        self.events: list[dict[str, Any]] = []

    def __enter__(self) -> Browser:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.call("Browser.close")
            self._process.wait(PATIENCE)
        finally:
            self._process.kill()
            self._process.wait()
            os.close(self._commands)
            os.close(self._events)
            self._profile.cleanup()

    def call(self, method: str, session: str | None = None, **params: Any) -> dict[str, Any]:
        """Send a command and wait for its answer; events that come meanwhile are kept."""
        self._last += 1
        message = {"id": self._last, "method": method, "params": params}
        if session is not None:
            message["sessionId"] = session
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        answer = self._wait(lambda got: got.get("id") == message["id"])
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        result: dict[str, Any] = answer["result"]
        return result

    def wait_for_load(self, loader: str) -> None:
        """Wait until what a navigation began is loaded, unless it is already; a blank page before it does not count."""
        wanted = {"loaderId": loader, "name": "load"}

        def loaded(event: dict[str, Any]) -> bool:
            return event.get("method") == "Page.lifecycleEvent" and wanted.items() <= event["params"].items()

        if not any(map(loaded, self.events)):
            self._wait(loaded)

    def _wait(self, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        deadline = time.monotonic() + PATIENCE
        while True:
            message = self._next(deadline)
            if "method" in message:
                self.events.append(message)
            if wanted(message):
                return message

    def _next(self, deadline: float) -> dict[str, Any]:
        while b"\0" not in self._unread:
            ready, _, _ = select.select([self._events], [], [], max(0.0, deadline - time.monotonic()))
            received = os.read(self._events, 1 << 20) if ready else b""
            if not received:
                raise RuntimeError(f"the browser said nothing for {PATIENCE:g} s, or went away")
            self._unread += received
        text, _, self._unread = self._unread.partition(b"\0")
        message: dict[str, Any] = json.loads(text)
        return message

    def open(
        self, path: Path | str, *, width: int = 1280, height: int = 900, dark: bool = False, query: str = ""
    ) -> Page:
        """Load a file, or what is at an address, into a new tab, with a query in its address."""
        return Page(self, path, width, height, dark, query)


class Page:
    """A tab with a page in it."""

    def __init__(self, browser: Browser, path: Path | str, width: int, height: int, dark: bool, query: str) -> None:
        self._browser = browser
        target = browser.call("Target.createTarget", url="about:blank")["targetId"]
        self._session: str = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        phone = width < 600
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=2 if phone else 1, mobile=phone,
        )  # fmt: skip
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.url = (path if isinstance(path, str) else path.resolve().as_uri()) + (f"?{query}" if query else "")
        self.call("Page.setLifecycleEventsEnabled", enabled=True)
        browser.wait_for_load(self.call("Page.navigate", url=self.url)["loaderId"])

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """A command for this tab."""
        return self._browser.call(method, self._session, **params)

    def evaluate(self, script: str) -> Any:
        """The value of an expression; a promise is awaited."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"])
        return answer["result"].get("value")

    def click(self, selector: str) -> None:
        """Scroll an element into view and click its middle with the mouse."""
        x, y = self.middle(selector)
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def point(self, x: float, y: float) -> None:
        """Move the mouse to a place in the window."""
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def middle(self, selector: str) -> tuple[float, float]:
        """Middle of an element in the window, after scrolling to it.

        Two frames later: where a click hits is found in the frame that is shown, which may be the one before.
        """
        name = json.dumps(selector)
        x, y = self.evaluate(
            f"(async () => {{ const element = document.querySelector({name}); "
            "element.scrollIntoView({block: 'center', behavior: 'instant'}); "
            "const next = /native/.test(requestAnimationFrame) ? requestAnimationFrame : queueMicrotask; "
            "const frame = () => new Promise((done) => { next(done); setTimeout(done, 200); }); "
            "await frame(); await frame(); const box = element.getBoundingClientRect(); "
            "return [box.x + box.width / 2, box.y + box.height / 2]; })()"
        )
        return float(x), float(y)

    def wheel(self, x: float, y: float, by: float) -> None:
        """Turn the mouse's wheel at a place in the window; below 0: away from the hand."""
        self.call("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=by)

    def drag(self, x: float, y: float, dx: float, dy: float) -> None:
        """Press the mouse's button at a place in the window, move it in steps, and let it go."""
        self.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", clickCount=1)
        for share in (0.3, 0.7, 1.0):
            place = {"x": x + share * dx, "y": y + share * dy}
            self.call("Input.dispatchMouseEvent", type="mouseMoved", button="left", buttons=1, **place)
        self.call("Input.dispatchMouseEvent", type="mouseReleased", x=x + dx, y=y + dy, button="left", clickCount=1)

    def pinch(self, x: float, y: float, before: float, after: float) -> None:
        """Put two fingers side by side around a place in the window, so many pixels from it, and move them apart."""
        self.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=2)
        for kind, apart in (("touchStart", before), ("touchMove", (before + after) / 2), ("touchMove", after)):
            points = [{"x": x - apart, "y": y, "id": 0}, {"x": x + apart, "y": y, "id": 1}]
            self.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def press(self, key: str, *, shift: bool = False) -> None:
        """Press and release a key, wherever the focus is."""
        code, name, text = _KEYS[key]
        common = {"key": key, "code": name, "windowsVirtualKeyCode": code, "modifiers": 8 if shift else 0}
        self.call("Input.dispatchKeyEvent", type="keyDown" if text else "rawKeyDown", text=text, **common)
        self.call("Input.dispatchKeyEvent", type="keyUp", **common)

    def screenshot(self, path: Path, *, whole: bool = True) -> None:
        """Write a PNG of the page, or of the window."""
        data = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole, **self._clip(whole))
        path.write_bytes(base64.b64decode(data["data"]))

    def _clip(self, whole: bool) -> dict[str, Any]:
        if not whole:
            return {}
        size = self.call("Page.getLayoutMetrics")["cssContentSize"]
        return {"clip": {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}}

    def complaints(self) -> list[Any]:
        """What went to the console, uncaught exceptions, and what the browser itself logged."""
        methods = ("Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded")
        return [event["params"] for event in self._mine() if event["method"] in methods]

    def requests(self) -> list[str]:
        """Addresses that were asked for."""
        return [
            event["params"]["request"]["url"]
            for event in self._mine()
            if event["method"] == "Network.requestWillBeSent"
        ]

    def _mine(self) -> list[dict[str, Any]]:
        self.evaluate("1")  # an answer comes after all events before it
        return [event for event in self._browser.events if event.get("sessionId") == self._session]
