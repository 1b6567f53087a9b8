"""Headless Chromium over its debugging pipe: JSON ended by a zero byte on descriptors 3 and 4, nothing else needed."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome")
QUIET = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--hide-scrollbars", "--remote-debugging-pipe",
)  # fmt: skip
LOCAL = ("file:", "data:", "blob:", "about:")
NAVIGATED = -32000  # DevTools protocol: the page that was asked is gone


class NavigatedError(Exception):
    """The page went to another while it was asked."""


def binary() -> str | None:
    """Where Chromium is; None if it is not installed."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


class Browser:
    """One tab."""

    def __init__(self, profile: Path) -> None:
        here, there = os.pipe(), os.pipe()
        ends = here[0], there[1]

        def hand_over() -> None:
            for copy, end in zip((13, 14), ends, strict=True):
                os.dup2(end, copy)
            os.dup2(13, 3)
            os.dup2(14, 4)

        self.process = subprocess.Popen(
            [str(binary()), *QUIET, f"--user-data-dir={profile}", "about:blank"],
            preexec_fn=hand_over, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        for end in ends:
            os.close(end)
        self.write, self.read = here[1], there[0]
        self.buffer, self.number, self.session = b"", 0, ""
        self.events: list[dict[str, Any]] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def close(self) -> None:
        self.process.terminate()
        self.process.wait(timeout=20)
        os.close(self.write)
        os.close(self.read)

    def _next(self, patience: float) -> dict[str, Any]:
        while b"\0" not in self.buffer:
            if not select.select([self.read], [], [], patience)[0]:
                raise TimeoutError("Chromium does not answer.")
            self.buffer += os.read(self.read, 1 << 20)
        message, _, self.buffer = self.buffer.partition(b"\0")
        return json.loads(message)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """One command of the DevTools protocol and its answer."""
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next(60.0)
            if answer.get("id") == self.number:
                if answer.get("error", {}).get("code") == NAVIGATED:
                    raise NavigatedError(answer["error"]["message"])
                assert "error" not in answer, answer
                return answer["result"]
            self.events.append(answer)

    def js(self, expression: str) -> Any:
        """Value of an expression; a promise is awaited."""
        found = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def wait(self, expression: str, patience: float = 30.0) -> None:
        """Until an expression is true, on whatever page the browser comes to meanwhile."""
        start = time.monotonic()
        while not self._true_here(expression):
            assert time.monotonic() - start < patience, f"never true: {expression}"
            time.sleep(0.05)

    def _true_here(self, expression: str) -> bool:
        try:
            return bool(self.js(expression))
        except NavigatedError:
            return False

    def follow(self, expression: str, arrival: str) -> None:
        """Do what leads to another page; ends where the other is loaded and `arrival` is true."""
        with suppress(NavigatedError):
            self.js(expression)
        self.wait(f"document.readyState === 'complete' && {arrival}")

    def open(self, path: Path, width: int = 1400, theme: str = "light", anchor: str = "") -> None:
        """One page, loaded; what was said before is forgotten."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=1000, deviceScaleFactor=1, mobile=False)
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": theme}])
        self.call("Page.navigate", url="about:blank")
        self.events.clear()
        self.call("Page.navigate", url=path.as_uri() + anchor)
        self.wait("location.protocol === 'file:' && document.readyState === 'complete'")

    def picture(self, selector: str) -> bytes:
        """A screenshot of one element."""
        box = self.js(
            f"(() => {{ const r = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
            " return { x: r.x + scrollX, y: r.y + scrollY, width: r.width, height: r.height, scale: 1 }; })()"
        )
        shot = self.call("Page.captureScreenshot", format="png", clip=box, captureBeyondViewport=True)
        return base64.b64decode(shot["data"])

    def complaints(self) -> list[str]:
        """Errors and warnings of the console, and requests that leave the machine."""
        self.js("1")
        found = []
        for event in self.events:
            told = event.get("params", {})
            kind = event.get("method")
            if kind == "Runtime.consoleAPICalled" and told["type"] in ("error", "warning"):
                found.append(f"{told['type']}: {[part.get('value') for part in told['args']]}")
            elif kind == "Runtime.exceptionThrown":
                found.append(str(told["exceptionDetails"]))
            elif kind == "Log.entryAdded" and told["entry"]["level"] in ("error", "warning"):
                found.append(told["entry"]["text"])
            elif kind == "Network.requestWillBeSent" and not told["request"]["url"].startswith(LOCAL):
                found.append(f"request: {told['request']['url']}")
        return found
