#!/usr/bin/env python3
"""Opens pages of runs and studies in a real browser (Chromium, headless, through its WebDriver).

    tests/pages_in_a_browser.py PAGE.html... [--pictures FOLDER]

A page fails when the console says anything, when a picture is missing or empty, when it is wider than the window (1280
pixels, and 390 as on a phone), or when its text is smaller than can be read there. --pictures keeps what the browser shows.
Packages: chromium, chromium-driver.
"""
import argparse
import base64
import json
import pathlib
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

WIDTHS = (1280, 390)
LOOK = """
const images = [...document.images];
const wide = [...document.querySelectorAll('body *')].filter(e => {
  const box = e.getBoundingClientRect();
  let inside = e.parentElement;  // what scrolls by itself is no overflow of the page
  while (inside && inside !== document.body) {
    if (['auto', 'scroll', 'hidden'].includes(getComputedStyle(inside).overflowX)) return false;
    inside = inside.parentElement;
  }
  return box.width > 0 && box.right > arguments[0] + 1;
});
return {
  title: document.title,
  width: document.documentElement.scrollWidth,
  images: images.length,
  empty: images.filter(i => !i.complete || i.naturalWidth === 0).map(i => i.alt),
  unnamed: images.filter(i => !i.alt).length,
  wide: wide.slice(0, 5).map(e => e.tagName + ' ' + e.textContent.slice(0, 40)),
  headings: document.querySelectorAll('h1, h2').length,
  smallest: Math.min(...[...document.querySelectorAll('p, td, li')].map(e => parseFloat(getComputedStyle(e).fontSize))),
};
"""


class Browser:
    def __init__(self, profile):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.driver = subprocess.Popen(["chromedriver", f"--port={self.port}"], stdout=subprocess.DEVNULL,
                                       stderr=subprocess.DEVNULL)
        arguments = ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars",
                     f"--user-data-dir={profile}"]
        capabilities = {"alwaysMatch": {"goog:chromeOptions": {"args": arguments},
                                        "goog:loggingPrefs": {"browser": "ALL"}}}
        deadline = time.monotonic() + 60
        while True:
            try:
                self.session = self.post("", {"capabilities": capabilities}, root=True)["sessionId"]
                return
            except urllib.error.URLError:
                if self.driver.poll() is not None or time.monotonic() > deadline:
                    raise
                time.sleep(0.1)

    def post(self, path, body, root=False):
        session = "" if root else f"/{self.session}"
        request = urllib.request.Request(f"http://127.0.0.1:{self.port}/session{session}{path}",
                                         json.dumps(body).encode(), {"Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=120) as answer:
            return json.load(answer)["value"]

    def command(self, name, **parameters):
        """Of the browser's own protocol."""
        return self.post("/goog/cdp/execute", {"cmd": name, "params": parameters})

    def close(self):
        try:
            urllib.request.urlopen(urllib.request.Request(
                f"http://127.0.0.1:{self.port}/session/{self.session}", method="DELETE"), timeout=30)
        finally:
            self.driver.terminate()
            self.driver.wait()


def faults(browser, page, width, pictures):
    browser.command("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1,
                    mobile=width < 600)
    browser.post("/url", {"url": page.resolve().as_uri()})
    seen = browser.post("/execute/sync", {"script": LOOK, "args": [width]})
    console = browser.post("/se/log", {"type": "browser"})
    if pictures:
        shot = browser.command("Page.captureScreenshot", format="png", captureBeyondViewport=True)
        pictures.mkdir(parents=True, exist_ok=True)
        (pictures / f"{page.stem}-{width}.png").write_bytes(base64.b64decode(shot["data"]))
    found = [f"console: {line['message']}" for line in console]
    found += [f"picture '{name}' is empty" for name in seen["empty"]]
    if seen["images"] == 0:
        found.append("there is no picture")
    if seen["unnamed"]:
        found.append(f"{seen['unnamed']} pictures have no text for those who cannot see them")
    if seen["width"] > width:  # a phone makes its window as wide as what is in it
        found.append(f"{seen['width']} pixels wide: {seen['wide']}")
    if seen["headings"] < 3 or not seen["title"]:
        found.append("it has no title or hardly any heading")
    if seen["smallest"] < 12:
        found.append(f"text of {seen['smallest']} pixels")
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pages", nargs="+", type=pathlib.Path)
    parser.add_argument("--pictures", type=pathlib.Path)
    options = parser.parse_args()
    bad = 0
    with tempfile.TemporaryDirectory() as profile:
        browser = Browser(profile)
        try:
            for page in options.pages:
                for width in WIDTHS:
                    found = faults(browser, page, width, options.pictures)
                    print(f"{page} at {width} pixels: {'; '.join(found) or 'good'}")
                    bad += bool(found)
        finally:
            browser.close()
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
