#!/usr/bin/env python3
"""Looks at a page of whittle report in a headless Chromium, through chromedriver's protocol.

usage: browser.py PAGE.html LEVELS       are the view and its controls alive? one line a failure
       browser.py PAGE.html --play      the same of a page of whittle replay
       browser.py PAGE.html --pictures DIR    screenshots: first screen, view, dark, a phone's width;
                                              and print.pdf, the page on paper
       browser.py PAGE.html --levels DIR      screenshots of a page of whittle replay: three levels

Nothing but Python's standard library. Status 77 where there is no Chromium, 1 after failures.
"""
import base64
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import urllib.request

CHROMIUM = ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run",
            "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
            "--disable-background-networking", "--disable-component-update", "--disable-sync",
            "--hide-scrollbars"]
WAIT = 60  # seconds, for what takes a moment on a quiet machine
LONGEST = 300  # seconds, for one request: a page of a large mesh, drawn without a graphics card


class Browser:
    """A chromedriver of our own, and one window."""

    def __init__(self, size, *more):
        self.driver = subprocess.Popen(["chromedriver", "--port=0"], stdout=subprocess.PIPE,
                                       stderr=subprocess.DEVNULL, text=True, start_new_session=True)
        port = None
        while port is None:
            line = self.driver.stdout.readline()
            if not line:
                raise OSError("chromedriver did not start")
            found = re.search(r"successfully on port (\d+)", line)
            port = found and found.group(1)
        self.url = f"http://127.0.0.1:{port}/session"
        options = {"args": CHROMIUM + [f"--window-size={size[0]},{size[1]}"] + list(more),
                   "binary": shutil.which("chromium")}
        limits = {"script": LONGEST * 1000, "pageLoad": LONGEST * 1000}
        made = self.ask("", {"capabilities": {"alwaysMatch": {
            "timeouts": limits, "goog:chromeOptions": options,
            "goog:loggingPrefs": {"browser": "ALL"}}}})
        self.url += "/" + made["sessionId"]

    def ask(self, what, body=None, method=None):
        request = urllib.request.Request(
            self.url + what, json.dumps(body).encode() if body is not None else None,
            {"Content-Type": "application/json"}, method=method)
        with urllib.request.urlopen(request, timeout=LONGEST + 30) as answer:
            return json.load(answer)["value"]

    def run(self, script):
        return self.ask("/execute/sync", {"script": script, "args": []})

    def cdp(self, command, **params):
        return self.ask("/goog/cdp/execute", {"cmd": command, "params": params})

    def open(self, path):
        self.ask("/url", {"url": "file://" + os.path.abspath(path)})

    def until(self, script):
        end = time.monotonic() + WAIT
        while time.monotonic() < end:
            if self.run("return !!(" + script + ")"):
                return True
            time.sleep(0.1)
        return False

    def keys(self, text):
        actions = [{"type": kind, "value": key} for key in text for kind in ("keyDown", "keyUp")]
        self.ask("/actions", {"actions": [{"type": "key", "id": "keys", "actions": actions}]})

    def picture(self, path):
        with open(path, "wb") as f:
            f.write(base64.b64decode(self.ask("/screenshot")))

    def close(self):
        try:
            self.ask("", method="DELETE")
        finally:
            os.killpg(self.driver.pid, signal.SIGTERM)
            self.driver.wait()


# What the canvas shows: how many colours, how much of it is covered, and how much of it is more green than red,
# and a checksum.
LOOK = """
const from = document.getElementById('canvas'), to = document.createElement('canvas');
to.width = 160; to.height = 120;
const g = to.getContext('2d', { willReadFrequently: true });
g.drawImage(from, 0, 0, 160, 120);
const p = g.getImageData(0, 0, 160, 120).data, seen = new Set();
let covered = 0, green = 0, sum = 0;
for (let i = 0; i < p.length; i += 4) {
    seen.add(p[i] << 16 | p[i + 1] << 8 | p[i + 2]);
    covered += p[i + 3] > 0;
    green += p[i + 1] > p[i] + 3;
    sum = (sum * 31 + p[i] + p[i + 3]) % 1000000007;
}
return { colours: seen.size, covered: covered / (160 * 120), green: green / (160 * 120), sum };
"""
COUNT = "return document.getElementById('count').textContent"
FOCUS = "document.getElementById('canvas').focus()"


def settled(browser):
    """What the canvas shows once the frame that was asked for is drawn."""
    browser.ask("/execute/async", {"args": [], "script":
                "const done = arguments[0]; requestAnimationFrame(() => setTimeout(done, 0));"})
    return browser.run(LOOK)


def check_view(browser, levels, fail):
    if not browser.until("document.getElementById('count').textContent"):
        fail("no level is shown: " + browser.run("return document.getElementById('trouble').textContent"))
        return
    first = settled(browser)
    if first["colours"] < 20 or not 0.1 < first["covered"] < 0.95:
        fail(f"the canvas is not drawn: {first}")
    counts = []
    for i in range(levels):
        browser.run(f"document.querySelectorAll('#levels input')[{i}].click()")
        counts.append(browser.run(COUNT))
    if len(set(counts)) != levels or not all("triangles" in c for c in counts):
        fail(f"levels do not change the count: {counts}")
    for what, key in (("the arrow", "\ue012"), ("+", "+"), ("W", "w"), ("F", "f")):
        browser.run(FOCUS)
        before = settled(browser)
        browser.keys(key)
        if settled(browser)["sum"] == before["sum"]:
            fail(f"the key {what} changes nothing")
    browser.keys("[")
    if levels > 1 and browser.run(COUNT) != counts[-2]:
        fail("the key [ does not go a level back")
    if browser.run("return document.getElementById('wireframe').getAttribute('aria-pressed')") != "true":
        fail("the button does not tell that edges are shown")


SLIDE = ("const s = document.getElementById('level'); s.value = {}; "
         "s.dispatchEvent(new Event('input'));")


def pressed(browser, button):
    return browser.run(f"return document.getElementById('{button}').getAttribute('aria-pressed')")


def check_play(browser, fail):
    def at(share):
        browser.run(SLIDE.format(share))
        return settled(browser)["sum"], browser.run(COUNT)

    def triangles():
        return int("".join(re.findall(r"\d", browser.run(COUNT).split("triangles")[0])))

    if not browser.until("document.getElementById('count').textContent"):
        fail("no level is shown: " + browser.run("return document.getElementById('trouble').textContent"))
        return
    first = settled(browser)
    if first["colours"] < 20 or not 0.1 < first["covered"] < 0.95:
        fail(f"the canvas is not drawn: {first}")
    if browser.run("return !!document.getElementById('colour')") != (first["green"] > 0.02):
        fail(f"the colours are not those of the vertices: {first}")
    up = [at(share) for share in (0, 250, 500, 750, 1000)]
    down = [at(share) for share in (1000, 750, 500, 250, 0)]
    if up != down[::-1] or len(set(up)) != 5:
        fail(f"levels up and down: {up} {down}")
    at(500)
    before = triangles()
    browser.run(FOCUS)
    browser.keys(".")
    after = triangles()
    if not before < after <= before + 2:
        fail(f"the key . goes from {before} to {after} triangles")
    browser.keys(",")
    if triangles() != before:
        fail("the key , does not go back")
    browser.keys("]")
    if not 1.6 * before < triangles() < 2.5 * before:
        fail(f"the key ] goes from {before} to {triangles()} triangles")
    ends = [at(share)[0] for share in (0, 1000)]
    browser.run(FOCUS)
    browser.keys("g")
    if pressed(browser, "morph") != "true" or [at(share)[0] for share in (0, 1000)] != ends:
        fail("a geomorph does not begin and end at its levels")
    way = [at(share) for share in range(480, 520, 10)]
    if len(set(way)) != len(way) or not all("between" in words for _, words in way):
        fail(f"a geomorph does not move: {way}")
    at(0)
    browser.run(FOCUS)
    browser.keys(" ")
    if not browser.until("document.getElementById('level').value > 100"):
        fail("Space does not play")
    browser.keys(" ")
    if pressed(browser, "play") != "false":
        fail("Space does not stop")
    browser.keys("b")
    if not browser.until("document.getElementById('level').value == 0"):
        fail("B does not play back")
    for what, key in (("the arrow", "\ue012"), ("+", "+"), ("W", "w"), ("F", "f")):
        seen = settled(browser)["sum"]
        browser.keys(key)
        if settled(browser)["sum"] == seen:
            fail(f"the key {what} changes nothing")


def check_page(browser, fail):
    loads = browser.run("return performance.getEntriesByType('resource').map(r => r.name)"
                        ".filter(n => !n.startsWith('data:'))")
    if loads:
        fail(f"the page loads {loads}")
    log = [m["message"] for m in browser.ask("/se/log", {"type": "browser"})
           if m["level"] == "SEVERE" or "Content Security" in m["message"]]
    if log:
        fail(f"the console says {log}")
    missing = browser.run("return [...document.images].filter(i => !i.alt || !i.complete || "
                          "!i.naturalWidth).length")
    if missing:
        fail(f"{missing} pictures without words or pixels")
    for width in (1280, 390):
        browser.cdp("Emulation.setDeviceMetricsOverride", width=width, height=844,
                    deviceScaleFactor=1, mobile=False)
        wide = browser.run("return document.documentElement.scrollWidth - innerWidth")
        if wide > 0:
            fail(f"the page is {wide} pixels wider than a window of {width}")


def check(page, check_it):
    failures = []
    browser = Browser((1280, 900))
    try:
        browser.open(page)
        check_it(browser, failures.append)
        browser.run("document.querySelectorAll('img').forEach(i => i.loading = 'eager')")
        browser.until("[...document.images].every(i => i.complete)")
        check_page(browser, failures.append)
    finally:
        browser.close()
    for text in failures:
        print("FAILED: " + text)
    return 1 if failures else 0


def pictures(page, folder):
    shots = (("first", (1280, 900), "light", None), ("view", (1280, 900), "light", "view"),
             ("maps", (1280, 900), "light", "maps"), ("distances", (1280, 900), "light", "distances"),
             ("runs", (1280, 900), "light", "runs"), ("dark", (1280, 900), "dark", None),
             ("dark-view", (1280, 900), "dark", "view"), ("dark-runs", (1280, 900), "dark", "runs"),
             ("phone", (390, 844), "light", None), ("phone-view", (390, 844), "light", "view"),
             ("phone-distances", (390, 844), "dark", "distances"),
             ("phone-runs", (390, 844), "light", "runs"))
    browser = Browser((1280, 900))
    try:
        for name, (w, h), scheme, place in shots:
            browser.cdp("Emulation.setDeviceMetricsOverride", width=w, height=h,
                        deviceScaleFactor=1, mobile=w < 600)
            browser.cdp("Emulation.setEmulatedMedia",
                        features=[{"name": "prefers-color-scheme", "value": scheme}])
            browser.open(page)
            browser.until("!document.getElementById('count') || "
                          "document.getElementById('count').textContent")
            browser.run(f"const e = document.getElementById('{place}'); if (e) e.scrollIntoView()")
            settled(browser) if browser.run("return !!document.getElementById('canvas')") else None
            time.sleep(0.5)
            browser.picture(f"{folder}/{name}.png")
        with open(f"{folder}/print.pdf", "wb") as f:
            f.write(base64.b64decode(browser.ask("/print", {"background": True})))
    finally:
        browser.close()
    return 0


def three_levels(page, folder):
    browser = Browser((900, 760))
    try:
        browser.open(page)
        browser.until("document.getElementById('count').textContent")
        for share in (0, 500, 1000):
            browser.run(SLIDE.format(share))
            settled(browser)
            browser.picture(f"{folder}/level-{share}.png")
    finally:
        browser.close()
    return 0


def main():
    if len(sys.argv) not in (3, 4):
        print(__doc__)
        return 2
    if not shutil.which("chromium") or not shutil.which("chromedriver"):
        print("skipped: no chromium and chromedriver here (Debian: chromium, chromium-driver)")
        return 77
    if sys.argv[2] == "--pictures":
        return pictures(sys.argv[1], sys.argv[3])
    if sys.argv[2] == "--levels":
        return three_levels(sys.argv[1], sys.argv[3])
    if sys.argv[2] == "--play":
        return check(sys.argv[1], check_play)
    levels = int(sys.argv[2])
    return check(sys.argv[1], lambda browser, fail: levels and check_view(browser, levels, fail))


if __name__ == "__main__":
    sys.exit(main())
