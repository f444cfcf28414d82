# SPDX-License-Identifier: MIT
"""Opens a report.html in Chromium without a network and prints as JSON what a reader finds.

    look_at_report.py REPORT [SCREENSHOT.png]

Runs in the environment of `tools/setup.sh browser`.
"""

import contextlib
import json
import pathlib
import sys

from playwright.sync_api import TimeoutError as Late, sync_playwright

ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SLIDER, TOP_VIEW = "#frame", ".figure"
DRAWN = "figures.every(({ div }) => Math.hypot(div._fullLayout.width - div.clientWidth, div._fullLayout.height - div.clientHeight) < 2)"


def open_page(browser, report, found, **options):
    page = browser.new_page(**options)
    page.on("console", lambda message: found["errors"].append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: found["errors"].append(str(error)))
    page.on("request", lambda request: found["requests"].append(request.url[:100]))
    page.goto(report.as_uri())
    page.wait_for_selector("body[data-shown=yes]", timeout=120000)
    page.wait_for_function(DRAWN, timeout=20000)
    return page


def x_range(page):
    return page.evaluate(f"document.querySelector('{TOP_VIEW}')._fullLayout.xaxis.range")


def middle_of_path(page):
    """On the screen, of the estimate's middle point in the top view."""
    return page.evaluate(f"""(() => {{
        const {{ section, div }} = figures[0], box = div.getBoundingClientRect(), layout = div._fullLayout;
        const trace = section.traces[section.frame_trace], k = Math.floor(trace.x.length / 2);
        return [box.x + layout._size.l + layout.xaxis.d2p(trace.x[k]), box.y + layout._size.t + layout.yaxis.d2p(trace.y[k])];
    }})()""")


def titles_in_the_way(page):
    """Those of axes that stand over another text or in a plot."""
    return page.evaluate("""figures.flatMap(({ div }) => {
        const elements = [...div.querySelectorAll("text, .nsewdrag")].map((element) => ({ element, box: element.getBoundingClientRect() }));
        const meet = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 2 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 2;
        return elements.filter(({ element, box }) => /^[xy][0-9]*title$/.test(element.getAttribute("class")) &&
            elements.some((other) => other.element !== element && meet(box, other.box))).map(({ element }) => element.textContent); })""")


def hard_to_read(page):
    """Texts that a figure's edge cuts, ticks upright or over each other, rows without a label."""
    return page.evaluate("""figures.flatMap(({ div }) => {
        const found = [], edge = div.getBoundingClientRect();
        const text_of = (element) => ({ text: element.textContent, element, box: element.getBoundingClientRect() });
        for (const { text, box } of [...div.querySelectorAll("text")].map(text_of))
            if (box.width > 0 && (box.left < edge.left - 1 || box.right > edge.right + 1 || box.top < edge.top - 1 || box.bottom > edge.bottom + 1))
                found.push("cut: " + text);
        for (const axis of ["x", "y"]) {
            const ticks = [...div.querySelectorAll("." + axis + "tick text")].map(text_of);
            ticks.forEach(({ text, element, box }, i) => {
                if (/rotate\\((?!0)/.test(element.getAttribute("transform"))) found.push("upright: " + text);
                if (ticks.slice(i + 1).some(({ box: other }) => Math.min(box.right, other.right) - Math.max(box.left, other.left) > 0 &&
                                                                  Math.min(box.bottom, other.bottom) - Math.max(box.top, other.top) > 3)) found.push("covered: " + text);
            });
            const shown = div._fullLayout[axis + "axis"];
            if (axis === "y" && shown?._categories?.length > ticks.length && Object.keys(div._fullLayout).filter((key) => /^yaxis/.test(key)).length === 1)
                found.push(shown._categories.length - ticks.length + " rows without a label");
        }
        return found; })""")


def pixels_at_edges_of_spaces(page):
    """Of each view in 3D, how many have not the ground's colour: 0 where nothing is cut."""
    return page.evaluate("""Promise.all(figures.filter(({ section }) => is_space(section)).map(async ({ div }) => {
        const image = new Image();
        image.src = await Plotly.toImage(div, { width: null, height: null });
        await image.decode();
        const { width, height } = image, context = new OffscreenCanvas(width, height).getContext("2d");
        context.drawImage(image, 0, 0);
        const edges = [[0, 0, 3, height], [width - 3, 0, 3, height], [0, 0, width, 3], [0, height - 3, width, 3]];
        const colours = edges.flatMap((edge) => [...new Uint32Array(context.getImageData(...edge).data.buffer)]);
        return colours.filter((colour) => colour !== colours[0]).length; }))""")


def swipe(page):
    """How far the page is scrolled by a finger that goes up over each figure, down at the page's end."""
    client = page.context.new_cdp_session(page)
    moved = []
    for figure in page.locator(".figure").all():
        figure.evaluate("(div) => scrollTo(0, div.getBoundingClientRect().top + scrollY - 150)")
        box, before = figure.bounding_box(), page.evaluate("scrollY")
        way = 10 if page.evaluate("scrollY + 2 * innerHeight") > page.evaluate("document.body.scrollHeight") else -10
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        client.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
        for step in range(1, 11):
            client.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [{"x": x, "y": y + way * step}]})
        client.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        page.wait_for_timeout(200)
        moved.append(abs(page.evaluate("scrollY") - before))
    return moved


def use(page, found):
    """What a page with a slider over frames does by keyboard, mouse and wheel."""
    page.focus(SLIDER)
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    found["by_keyboard"] = page.locator("#frames output").text_content()

    page.mouse.move(*middle_of_path(page))
    page.wait_for_selector(f"{TOP_VIEW} .hovertext", timeout=10000)
    found["hover"] = page.locator(f"{TOP_VIEW} .hovertext").first.text_content()
    found["by_hover"] = page.locator("#frames output").text_content()

    before = x_range(page)
    for _ in range(5):
        page.mouse.wheel(0, -100)
        page.wait_for_timeout(200)
    found["zoom"] = [before, x_range(page)]

    page.locator("section", has=page.locator("h2", has_text="Time per stage")).locator(".figure").hover()
    before = page.evaluate("scrollY")
    page.mouse.wheel(0, 100)
    with contextlib.suppress(Late):  # a busy machine scrolls late
        page.wait_for_function(f"scrollY > {before + 50}", timeout=5000)
    found["scrolled_over_a_chart"] = page.evaluate("scrollY") - before


def look(browser, report, screenshot):
    found = {"errors": [], "requests": []}
    page = open_page(browser, report, found, viewport={"width": 1200, "height": 900}, color_scheme="light")
    found["title"] = page.title()
    found["headings"] = page.locator("h2, summary").all_text_contents()
    found["figures"] = page.evaluate("document.querySelectorAll('.main-svg').length > 0 ? figures.length : 0")
    found["points"] = page.evaluate("figures.map(({ section }) => section.traces.reduce((sum, trace) => sum + trace.x.length, 0))")
    found["traces"] = page.evaluate("""Object.fromEntries(figures.map(({ section }) => [section.heading,
        Object.fromEntries(section.traces.map(({ name, x, y, z }) => [name, { x, y, z }]))]))""")
    found["categories"] = page.locator(".xtick text, .ytick text").all_text_contents()
    found["images"] = page.evaluate("[...document.images].map((image) => image.naturalWidth)")
    found["captions"] = page.locator("figcaption").all_text_contents()
    found["log_ticks"] = page.evaluate("""figures.flatMap(({ div }) => Object.keys(div._fullLayout)
        .filter((key) => /^[xy]axis/.test(key) && div._fullLayout[key].type === "log")
        .map((key) => div.querySelectorAll("." + key[0] + "tick text").length))""")
    found["colours"] = page.evaluate("""(() => {
        const colours = {};
        for (const { div } of figures)
            for (const { name, type, line, marker } of div._fullData)
                (colours[name] ??= []).push(type === "bar" || !line ? marker.color : line.color);
        return Object.fromEntries(Object.entries(colours).map(([name, found]) => [name, [...new Set(found)]])); })()""")
    found["light"] = page.evaluate("getComputedStyle(document.body).backgroundColor")
    if page.locator(SLIDER).is_visible():
        use(page, found)
    if screenshot:
        page.screenshot(path=screenshot, full_page=True)
    page.close()

    page = open_page(browser, report, found, viewport={"width": 360, "height": 740}, color_scheme="dark", has_touch=True, is_mobile=True)
    found["dark"] = page.evaluate("getComputedStyle(document.body).backgroundColor")
    found["phone_width"] = page.evaluate("document.documentElement.scrollWidth")
    found["buttons_over_legend"] = page.evaluate("""figures.filter(({ div }) => {
        const legend = div.querySelector(".legend"), buttons = div.querySelector(".modebar");
        return legend && buttons.getBoundingClientRect().bottom > legend.getBoundingClientRect().top; }).length""")
    found["titles_in_the_way"] = titles_in_the_way(page)
    found["hard_to_read"] = hard_to_read(page)
    found["at_edges_of_spaces"] = pixels_at_edges_of_spaces(page)
    found["swiped"] = swipe(page)
    page.close()

    page = open_page(browser, report, found, viewport={"width": 844, "height": 390}, has_touch=True, is_mobile=True)  # held sideways
    for size in ({"width": 844, "height": 390}, {"width": 390, "height": 844}):
        page.set_viewport_size(size)
        page.wait_for_function(DRAWN, timeout=20000)
        found["titles_in_the_way"] += titles_in_the_way(page)
        found["hard_to_read"] += hard_to_read(page)
    page.close()
    return found


def main():
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=ARGUMENTS)
        found = look(browser, pathlib.Path(sys.argv[1]).resolve(), sys.argv[2] if len(sys.argv) > 2 else None)
        browser.close()
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
