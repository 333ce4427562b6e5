"""A page of whittle report, read as HTML: it is whole, and needs nothing else.

usage: page.py PAGE.html LEVELS TITLE      one line a failure
"""
import base64
import html.parser
import json
import sys

VOID = {"meta", "link", "img", "br", "input", "rect"}


class Page(html.parser.HTMLParser):
    def __init__(self):
        super().__init__()
        self.open, self.ids, self.images, self.links = [], [], [], []
        self.texts, self.failures = {}, []

    def handle_starttag(self, tag, attrs):
        a = dict(attrs)
        if "id" in a:
            self.ids.append(a["id"])
        if tag == "img":
            self.images.append(a)
        self.links += [a[k] for k in ("src", "href") if k in a]
        if tag not in VOID:
            self.open.append((tag, a.get("id")))

    def handle_startendtag(self, tag, attrs):
        pass

    def handle_endtag(self, tag):
        if not self.open or self.open.pop()[0] != tag:
            self.failures.append(f"line {self.getpos()[0]}: </{tag}> closes nothing")

    def handle_data(self, text):
        if self.open:
            key = self.open[-1][1] or self.open[-1][0]
            self.texts[key] = self.texts.get(key, "") + text


def check(page, levels, title):
    bad = page.failures
    if page.open:
        bad.append(f"not closed: {page.open}")
    if len(set(page.ids)) != len(page.ids):
        bad.append(f"an id twice: {sorted(page.ids)}")
    bad += [f"not in the page: {link[:60]}" for link in page.links if not link.startswith("data:")]
    for image in page.images:
        if not image.get("alt"):
            bad.append("a picture without words")
        if base64.b64decode(image["src"].split(",")[1], validate=True)[1:4] != b"PNG":
            bad.append("a picture that is no PNG")
    if page.texts.get("title") != title or page.texts.get("h1") != title:
        bad.append(f"the title is {page.texts.get('title')}, {page.texts.get('h1')}")
    data = json.loads(page.texts["data"])
    if len(data["levels"]) != levels:
        bad.append(f"{len(data['levels'])} levels in the data")
    for i in range(levels if "mesh-0" in page.ids else 0):
        mesh = base64.b64decode(page.texts[f"mesh-{i}"], validate=True)
        level = data["levels"][i]
        if not 4 * level["shown_faces"] < len(mesh) < 12 * level["shown_faces"]:
            bad.append(f"{len(mesh)} bytes for {level['shown_faces']} faces")
    return bad


page = Page()
page.feed(open(sys.argv[1], encoding="utf-8").read())
failures = check(page, int(sys.argv[2]), sys.argv[3])
print("".join(f"FAILED: {text}\n" for text in failures), end="")
sys.exit(1 if failures else 0)
