"""A page in a browser, by what a reader sees and does."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement

READY_S = 20.0


class Browser:
    """A page in the browser, by what a reader sees and does."""

    def __init__(self, driver: webdriver.Chrome) -> None:
        self.driver = driver

    def open(self, path: Path, *, explorer: bool = True) -> None:
        """Open a file in the state of a fresh window; wait for its explorer."""
        for log in ("browser", "performance"):
            self.driver.get_log(log)
        self.command("Emulation.clearDeviceMetricsOverride")
        self.look(dark=False)
        self.driver.get(path.as_uri())
        until = time.monotonic() + READY_S
        while explorer and not self.run("return document.getElementById('explorer').dataset.ready || ''"):
            assert time.monotonic() < until, f"no explorer after {READY_S} s: {self.driver.get_log('browser')}"
            time.sleep(0.02)
        if explorer:
            self.settle()

    def command(self, name: str, **arguments: Any) -> Any:
        return self.driver.execute_cdp_cmd(name, arguments)

    def look(self, *, dark: bool, media: str = "") -> None:
        feature = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.command("Emulation.setEmulatedMedia", media=media, features=[feature])

    def run(self, script: str, *arguments: Any) -> Any:
        return self.driver.execute_script(script, *arguments)

    def settle(self) -> None:
        """Wait until what was asked for is drawn."""
        self.driver.execute_async_script(
            "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done()))"
        )

    def find(self, name: str) -> WebElement:
        return self.driver.find_element(By.ID, f"x-{name}")

    def text(self, name: str) -> str:
        return str(self.run(f"return document.getElementById('x-{name}').textContent"))

    def picture(self) -> str:
        self.settle()
        return str(self.run("return document.getElementById('x-canvas').toDataURL()"))

    def facts(self) -> dict[str, str]:
        """Return the numbers shown beside the picture, by measure."""
        self.settle()
        told = self.run(
            "return [...document.querySelectorAll('[data-measure]')].map(e => [e.dataset.measure, e.textContent])"
        )
        return dict(told)

    def visible(self, selector: str) -> list[bool]:
        return list(
            self.run("return [...document.querySelectorAll(arguments[0])].map(one => one.offsetHeight > 0)", selector)
        )

    def requests(self) -> list[str]:
        """Addresses of all that the page asked for."""
        messages = [json.loads(entry["message"])["message"] for entry in self.driver.get_log("performance")]
        return [m["params"]["request"]["url"] for m in messages if m["method"] == "Network.requestWillBeSent"]

    def complaints(self) -> list[dict[str, Any]]:
        """Errors and warnings of the console."""
        return list(self.driver.get_log("browser"))
