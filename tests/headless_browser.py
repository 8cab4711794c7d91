"""A headless Chromium, driven by its own WebDriver over plain HTTP."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
import time
import urllib.request
from pathlib import Path
from typing import Any

ARGUMENTS = [
    "--headless=new",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
BINARIES = ("chromium", "chromium-browser", "google-chrome")


def is_available() -> bool:
    """Tell whether Chromium and its driver are installed."""
    return shutil.which("chromedriver") is not None and any(map(shutil.which, BINARIES))


class Browser:
    """One window; closed with everything it started when the `with` block ends."""

    def __init__(self, width: int, height: int, dark: bool = False) -> None:
        self._size = (width, height)
        self._dark = dark

    def __enter__(self) -> Browser:
        self._driver = subprocess.Popen(
            ["chromedriver", "--port=0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        self._address = f"http://127.0.0.1:{self._port()}"
        binary = next(path for path in map(shutil.which, BINARIES) if path)
        options = {
            "binary": binary,
            "args": [*ARGUMENTS, "--window-size={},{}".format(*self._size)],
        }
        capabilities = {
            "browserName": "chrome",
            "goog:chromeOptions": options,
            "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"},
        }
        answer = self._send("POST", "/session", {"capabilities": {"alwaysMatch": capabilities}})
        self._session = f"/session/{answer['sessionId']}"
        width, height = self._size
        # Windows have a least width that phones fall below; the emulated screen has none.
        self.devtools(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=width < 500,
        )  # fmt: skip
        scheme = "dark" if self._dark else "light"
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.devtools("Emulation.setEmulatedMedia", features=features)
        return self

    def __exit__(self, *error: object) -> None:
        try:
            self._send("DELETE", self._session)
        finally:
            self._driver.terminate()
            self._driver.wait(10)
            self._driver.stdout.close()

    def open(self, page: Path) -> None:
        """Open a file."""
        self._send("POST", f"{self._session}/url", {"url": page.resolve().as_uri()})

    def run(self, script: str, *arguments: Any) -> Any:
        """Run a script in the page and return what it returns."""
        body = {"script": script, "args": list(arguments)}
        return self._send("POST", f"{self._session}/execute/sync", body)

    def wait_for(self, script: str, seconds: float = 60.0) -> Any:
        """Run a script until it returns something true."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            found = self.run(script)
            if found:
                return found
            time.sleep(0.05)
        raise AssertionError(f"waited {seconds} s in vain for: {script}")

    def press(self, key: str) -> None:
        """Press a key where the focus is."""
        strokes = [{"type": kind, "value": key} for kind in ("keyDown", "keyUp")]
        actions = [{"type": "key", "id": "keyboard", "actions": strokes}]
        self._send("POST", f"{self._session}/actions", {"actions": actions})

    def drag(self, selector: str, right: int, down: int) -> None:
        """Drag the pointer from the middle of an element."""
        element = self._send(
            "POST", f"{self._session}/element", {"using": "css selector", "value": selector}
        )
        moves = [
            {"type": "pointerMove", "origin": element, "x": 0, "y": 0, "duration": 0},
            {"type": "pointerDown", "button": 0},
            {"type": "pointerMove", "origin": element, "x": right, "y": down, "duration": 100},
            {"type": "pointerUp", "button": 0},
        ]
        actions = [{"type": "pointer", "id": "mouse", "actions": moves}]
        self._send("POST", f"{self._session}/actions", {"actions": actions})

    def console(self) -> list[str]:
        """Return the messages of the console since the last call."""
        return [entry["message"] for entry in self._log("browser")]

    def requests(self) -> list[str]:
        """Return the addresses asked for since the last call, without data that is inline."""
        entries = [json.loads(entry["message"])["message"] for entry in self._log("performance")]
        sent = [
            entry["params"]["request"]["url"]
            for entry in entries
            if entry["method"] == "Network.requestWillBeSent"
        ]
        return [address for address in sent if not address.startswith(("data:", "blob:"))]

    def screenshot(self, path: Path, *, whole: bool = False) -> None:
        """Write a picture of the window, or of the whole page."""
        result = self.devtools("Page.captureScreenshot", captureBeyondViewport=whole)
        path.write_bytes(base64.b64decode(result["data"]))

    def devtools(self, command: str, **parameters: Any) -> Any:
        """Run a command of the browser's developer tools."""
        body = {"cmd": command, "params": parameters}
        return self._send("POST", f"{self._session}/goog/cdp/execute", body)

    def _log(self, kind: str) -> Any:
        return self._send("POST", f"{self._session}/se/log", {"type": kind})

    def _port(self) -> int:
        for line in self._driver.stdout:
            if b"started successfully on port" in line:
                return int(line.split()[-1].rstrip(b"."))
        raise RuntimeError("chromedriver ended before it was ready")

    def _send(self, method: str, path: str, body: Any = None) -> Any:
        request = urllib.request.Request(
            self._address + path,
            data=None if body is None else json.dumps(body).encode(),
            method=method,
            headers={"Content-Type": "application/json"},
        )
        # Loopback only: a proxy of the environment has no say.
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        with opener.open(request, timeout=60) as answer:
            return json.load(answer)["value"]
