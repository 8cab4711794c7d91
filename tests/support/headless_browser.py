"""A headless Chromium, driven by Selenium with the events of a mouse, a keyboard and fingers."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from sockets import folder_of_sockets

_ARGUMENTS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-watchdog",  # on a busy machine, drawing may take longer than it allows
    "--disable-smooth-scrolling",  # a turn of the wheel has its whole effect at once
)
_PATIENCE = 120.0  # seconds; whatever takes longer will not come
_BINARIES = ("chromium", "chromium-browser", "google-chrome")


@contextmanager
def opened_browser() -> Iterator[Browser]:
    """Open a browser, and close it in the end.

    Without Chromium and its driver the test is skipped; in continuous integration, where the
    variable CI is set, it fails.
    """
    binary = next((path for path in map(shutil.which, _BINARIES) if path), None)
    driver = shutil.which("chromedriver")
    if binary is None or driver is None:
        missing = "Chromium and its driver are not installed"
        pytest.fail(missing) if os.environ.get("CI") else pytest.skip(missing)
    webdriver = pytest.importorskip("selenium.webdriver")
    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for argument in _ARGUMENTS:
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    environment = os.environ | {"TMPDIR": folder_of_sockets()}
    chrome = webdriver.Chrome(options, webdriver.ChromeService(driver, env=environment))
    chrome.set_script_timeout(_PATIENCE)
    try:
        yield Browser(chrome)
    finally:
        chrome.quit()


class Browser:
    """One window."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver

    def open(self, page: Path, width: int, height: int, *, dark: bool = False) -> None:
        """Open a file in a window, or on a screen, of this size."""
        # Windows have a least width that phones fall below; the emulated screen has none.
        self.devtools(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=width < 500,
        )  # fmt: skip
        scheme = "dark" if dark else "light"
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.devtools("Emulation.setEmulatedMedia", features=features)
        self.driver.get("about:blank")
        self.console()
        self.requests()
        self.driver.get(page.resolve().as_uri())

    def open_viewer(self, page: Path, width: int, height: int, *, dark: bool = False) -> None:
        """Open the page of a viewer, and wait until it is drawn."""
        self.open(page, width, height, dark=dark)
        self.wait_for("return document.querySelector('.viewer').dataset.ready")

    def run(self, script: str, *arguments: Any) -> Any:
        """Run a script in the page and return what it returns."""
        return self.driver.execute_script(script, *arguments)

    def find(self, selector: str) -> Any:
        """Return the first element that a CSS selector names."""
        return self.driver.find_element("css selector", selector)

    def wait_for(self, script: str, seconds: float = _PATIENCE) -> Any:
        """Run a script until it returns something true."""
        from selenium.webdriver.support.wait import WebDriverWait

        waiting = WebDriverWait(self.driver, seconds, poll_frequency=0.02)
        return waiting.until(lambda _: self.run(script), f"waited in vain for: {script}")

    def wait_for_picture(self) -> None:
        """Wait until the first viewer has drawn all that was asked of it, outlines smooth.

        What the window asks for, such as another size or theme, comes with one of its frames.
        """
        self.wait_for(
            "return new Promise((tell) => requestAnimationFrame(() => requestAnimationFrame("
            "() => tell(document.querySelector('.viewer').dataset.fine === 'true'))))"
        )

    def actions(self) -> Any:
        """Return a chain of actions of the mouse and the keyboard, without pauses."""
        from selenium.webdriver.common.action_chains import ActionChains

        return ActionChains(self.driver, duration=20)

    def press(self, *keys: str) -> None:
        """Press keys where the focus is."""
        self.actions().send_keys(*keys).perform()

    def wheel(self, element: Any, right: int, below: int, pixels: int) -> None:
        """Turn the wheel at a place, from the middle of an element; up is negative."""
        from selenium.webdriver.common.actions.wheel_input import ScrollOrigin

        origin = ScrollOrigin.from_element(element, right, below)
        self.actions().scroll_from_origin(origin, 0, pixels).perform()

    def drag(
        self, element: Any, right: int, below: int, *, shift: bool = False, button: int = 0
    ) -> None:
        """Drag from the middle of an element, with Shift or another button of the mouse."""
        from selenium.webdriver.common.actions.action_builder import ActionBuilder

        builder = ActionBuilder(self.driver, duration=20)
        if shift:
            builder.key_action.key_down("\ue008")
        for _ in range(2):
            builder.key_action.pause()
        builder.pointer_action.move_to(element)
        builder.pointer_action.pointer_down(button)
        builder.pointer_action.move_to(element, right, below)
        builder.pointer_action.pointer_up(button)
        builder.perform()
        builder.clear_actions()

    def double_click(self, element: Any, right: int, below: int) -> None:
        """Click twice at a place, from the middle of an element, however long the events take."""
        script = (
            "const box = arguments[0].getBoundingClientRect();"
            "return [box.x + box.width / 2, box.y + box.height / 2];"
        )
        x, y = self.run(script, element)
        place = {"x": x + right, "y": y + below}
        for number in (1, 2):
            for kind in ("mousePressed", "mouseReleased"):
                self.devtools(
                    "Input.dispatchMouseEvent", type=kind, button="left", clickCount=number, **place
                )

    def touch(self, kind: str, *fingers: tuple[float, float], at: float | None = None) -> None:
        """Put fingers on the screen, move them, or lift them: touchStart, touchMove, touchEnd.

        `at` is the time of the event in seconds since 1970, if it is not to be the present one.
        """
        points = [{"x": x, "y": y, "id": index} for index, (x, y) in enumerate(fingers)]
        moment = {} if at is None else {"timestamp": at}
        self.devtools("Input.dispatchTouchEvent", type=kind, touchPoints=points, **moment)

    def console(self) -> list[str]:
        """Return the messages of the console since the last call."""
        return [entry["message"] for entry in self.driver.get_log("browser")]

    def requests(self) -> list[str]:
        """Return the addresses asked for since the last call, without data that is inline."""
        logged = self.driver.get_log("performance")
        entries = [json.loads(entry["message"])["message"] for entry in logged]
        sent = [
            entry["params"]["request"]["url"]
            for entry in entries
            if entry["method"] == "Network.requestWillBeSent"
        ]
        inline = ("data:", "blob:", "about:")
        return [address for address in sent if not address.startswith(inline)]

    def devtools(self, command: str, **parameters: Any) -> Any:
        """Run a command of the browser's developer tools."""
        return self.driver.execute_cdp_cmd(command, parameters)
