"""Every page of a report in a real browser: what it logs, what it draws, how it fits a telephone, how tables sort."""

import json

import pytest

PHONE = 360

LOOKED_AT = r"""
const seen = (element) => { const box = element.getBoundingClientRect(); return box.width > 40 && box.height > 25; };
const luminance = (text) => {
  const [r, g, b] = text.match(/[0-9.]+/g).map(Number).map((v) => v / 255)
    .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const contrast = (a, b) => {
  const [high, low] = [luminance(a), luminance(b)].sort((x, y) => y - x);
  return (high + 0.05) / (low + 0.05);
};
const ground = getComputedStyle(document.querySelector(".vc")).backgroundColor;
const marked = (element) => {
  const box = element.getBoundingClientRect();
  return Math.max(box.width, box.height) > 3;
};
const upright = (svg) => [...svg.querySelectorAll("text")]
  .filter((t) => !/rotate\(-?90/.test(t.getAttribute("transform")))
  .map((t) => t.getBoundingClientRect()).filter((box) => box.width > 0);
const overlaps = (a, b) =>
  Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 &&
  Math.abs(a.bottom - b.bottom) < Math.min(a.height, b.height) / 4;
const pictures = [...document.querySelectorAll(".picture > svg")].map((svg) => ({
  drawn: seen(svg) && [...svg.querySelectorAll("path, use")].filter(marked).length > 4,
  overlapping: upright(svg).filter((a, k, all) => all.slice(k + 1).some((b) => overlaps(a, b))).length,
  words: Math.min(99, ...[...svg.querySelectorAll("text, tspan")]
    .map((t) => contrast(getComputedStyle(t).fill, ground))),
  size: svg.getBoundingClientRect().width / svg.viewBox.baseVal.width *
    Math.min(99, ...[...svg.querySelectorAll("text")].map((t) => parseFloat(getComputedStyle(t).fontSize))),
  alt: svg.parentElement.getAttribute("aria-label"),
}));
return JSON.stringify({
  pictures,
  ground,
  body: contrast(getComputedStyle(document.querySelector(".vc")).color, ground),
  soft: Math.min(99, ...[...document.querySelectorAll("dt, caption, .kind")]
    .map((e) => contrast(getComputedStyle(e).color, ground))),
  overflow: document.documentElement.scrollWidth - window.innerWidth,
  captions: Math.max(0, ...[...document.querySelectorAll("caption")]
    .map((c) => c.getBoundingClientRect().right - window.innerWidth)),
  headings: [...document.querySelectorAll("h1, h2, h3, h4")].map((h) => Number(h.tagName[1])),
  formulas: [...document.querySelectorAll("math")]
    .map((m) => m.getBoundingClientRect().width > 4 && !m.querySelector("merror")),
  identifiers: [...document.querySelectorAll("[id]")].map((e) => e.id),
  deadLinks: [...document.querySelectorAll("a[href^='#']")]
    .filter((a) => !document.getElementById(a.hash.slice(1))).length,
  requests: performance.getEntriesByType("resource").map((r) => r.name),
  sketches: [...document.querySelectorAll(".sketch svg path")].length,
  language: document.documentElement.lang,
});
"""


def opened(browser, path, *, width=1200, dark=False):
    """What a reader meets on a page at a width, in the light or in the dark."""
    metrics = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": width == PHONE}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    theme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [theme]})
    browser.get(path.as_uri())
    return json.loads(browser.execute_script(LOOKED_AT))


def pages(folder):
    return [folder / "index.html", *sorted(path for path in folder.rglob("*.html") if path.name != "index.html")]


@pytest.mark.parametrize(("width", "dark"), [(1200, False), (PHONE, True)])
def test_every_page_is_whole(browser, written, width, dark):
    for path in pages(written):
        found = opened(browser, path, width=width, dark=dark)
        assert browser.get_log("browser") == [], path
        assert found["requests"] == [], "a page needs nothing but itself"
        assert all(picture["drawn"] and picture["alt"] for picture in found["pictures"]), path
        assert not any(picture["overlapping"] for picture in found["pictures"]), f"words over each other in {path}"
        assert min([p["words"] for p in found["pictures"]] + [found["body"], found["soft"]]) >= 4.5, path
        assert all(found["formulas"]), path
        assert found["overflow"] <= 0, f"{path} is wider than the screen"
        assert found["captions"] <= 0, f"what a table of {path} is of ends beyond the screen"
        assert found["deadLinks"] == 0
        assert len(set(found["identifiers"])) == len(found["identifiers"]), "names within a page are its own"
        assert found["headings"][0] == 1
        steps = zip(found["headings"], found["headings"][1:], strict=False)
        assert all(after <= before + 1 for before, after in steps), "no level of headings is left out"
        assert found["language"] == "en"


def test_pages_follow_the_theme(browser, folder):
    path = folder / "mechanics" / "kepler.html"
    light, dark = (opened(browser, path, dark=dark) for dark in (False, True))
    assert light["ground"] == "rgb(255, 255, 255)"
    assert dark["ground"] == "rgb(20, 23, 28)"


def test_words_in_pictures_can_be_read_on_a_telephone(browser, folder):
    for path in (folder / "problems" / "bratu.html", folder / "optics" / "parabola_of_safety.html"):
        found = opened(browser, path, width=PHONE)
        assert len(found["pictures"]) >= 2
        assert min(picture["size"] for picture in found["pictures"]) > 7.5


def test_pages_hold_pictures_and_formulas(browser, folder):
    found = {path.stem: opened(browser, path) for path in pages(folder)}
    assert found["index"]["sketches"] >= 4
    assert len(found["kepler"]["pictures"]) == 2
    assert len(found["kepler"]["formulas"]) == 3  # the Lagrangian, and an equation a coordinate
    assert len(found["bratu"]["pictures"]) == 5  # two cases, and three of measurements
    assert len(found["without_minimum"]["pictures"]) == 0


def column(browser, table, number):
    cells = (
        f"[...arguments[0].tBodies[0].rows].map(r => [r.cells[{number}].textContent, r.cells[{number}].dataset.value])"
    )
    return browser.execute_script(f"return {cells}", table)


def test_tables_sort_by_each_column(browser, written):
    tables = [sorted_tables(browser, path) for path in pages(written)]
    assert max(tables) >= 5


def sorted_tables(browser, path):
    """Sort every table of a page by every column, both ways; how many there are."""
    opened(browser, path)
    tables = browser.find_elements("css selector", "table.sortable")
    for table in tables:
        for number, heading in enumerate(table.find_elements("css selector", "th")):
            numeric = heading.get_attribute("class") == "number"
            for order in ("ascending", "descending"):
                browser.execute_script("arguments[0].querySelector('button').click()", heading)
                assert heading.get_attribute("aria-sort") == order
                cells = column(browser, table, number)
                if numeric:
                    values = [float(value) for _, value in cells if value is not None]
                    assert values == sorted(values, reverse=order == "descending")
                    empty = [value is None for _, value in cells]
                    assert empty == sorted(empty), "what has no number comes last"
    return len(tables)
