"""Headless Chromium for tests: where it is found, and pages in it."""

import base64
import contextlib
import os
import shutil

import pytest

try:
    from selenium import webdriver
except ModuleNotFoundError:
    webdriver = None


_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_DRIVERS = ("chromedriver",)


def _missing():
    """What a browser's test lacks here, in words; empty where it has everything."""
    if webdriver is None:
        return "selenium is not installed"
    if not all(map(_found, (_BROWSERS, _DRIVERS))):
        return "no Chromium with its driver (Debian: apt-get install chromium chromium-driver)"
    return ""


def _found(names):
    return next(filter(None, map(shutil.which, names)), None)


def require_chromium():
    """Skips a test where there is no Chromium; in CI it fails."""
    if missing := _missing():
        (pytest.fail if os.environ.get("CI") else pytest.skip)(missing)


class Page:
    """A page in Chromium."""

    def __init__(self, driver):
        self.driver = driver

    def open(self, path, *, width=1200, height=900, dark=False, reduced=True):
        """Opens a file in a window of this size [px]."""
        features = {
            "prefers-color-scheme": "dark" if dark else "light",
            "prefers-reduced-motion": "reduce" if reduced else "no-preference",
        }
        media = [{"name": name, "value": value} for name, value in features.items()]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": media})
        self.resize(width=width, height=height)
        self.driver.get(f"file://{path}")
        return self

    def resize(self, *, width=1200, height=900):
        """Gives the window this size [px]."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)

    def run(self, script, *arguments):
        """What a function's body in JavaScript returns."""
        return self.driver.execute_script(script, *arguments)

    def find(self, selector):
        """The first element of a selector of CSS."""
        return self.driver.find_element("css selector", selector)

    def keys(self, *keys, shift=False):
        """Presses keys where the focus is, perhaps with Shift held."""
        actions = webdriver.ActionChains(self.driver)
        if shift:
            actions.key_down("\ue008").send_keys(*keys).key_up("\ue008").perform()
        else:
            actions.send_keys(*keys).perform()

    def press(self, element, x, y):
        """Presses an element at a point from its middle [px]."""
        actions = webdriver.ActionChains(self.driver)
        actions.move_to_element_with_offset(element, x, y).click().perform()

    def nameless(self):
        """Controls and pictures that a screen reader has no name for, of all that there are."""
        self.run("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
        script = "return [...document.querySelectorAll(arguments[0])]"
        kinds = "button, input, select, summary, [tabindex], svg[role=img], iframe"
        found = self.run(script, kinds)
        assert found
        return [each.get_attribute("outerHTML") for each in found if not each.accessible_name]

    def errors(self):
        """What the console has said."""
        return self.driver.get_log("browser")

    def screenshot(self, path):
        """Writes what the window shows."""
        shot = self.driver.execute_cdp_cmd("Page.captureScreenshot", {})
        path.write_bytes(base64.b64decode(shot["data"]))
        return path


@contextlib.contextmanager
def chromium():
    """A page in a headless Chromium, which is closed at the end."""
    require_chromium()
    options = webdriver.ChromeOptions()
    options.binary_location = _found(_BROWSERS)
    # CI may be root in a container, where Chromium's sandbox and /dev/shm are not to be had.
    for flag in ("headless=new", "no-sandbox", "disable-dev-shm-usage", "disable-gpu"):
        options.add_argument(f"--{flag}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(_found(_DRIVERS))
    driver = webdriver.Chrome(options=options, service=service)
    try:
        yield Page(driver)
    finally:
        driver.quit()
