# SPDX-License-Identifier: MIT
"""Opens a report.html in Chromium without a network and prints as JSON what a reader finds.

    look_at_report.py REPORT [--narrow] [SCREENSHOTS]       # SCREENSHOTS_1280.png, ..; --narrow: on the last of the screens alone

Runs in the environment of `tools/setup.sh browser`.
"""

import contextlib
import json
import pathlib
import sys

from playwright.sync_api import TimeoutError as Late, sync_playwright

ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SCREENS = ((1280, 900, False), (844, 390, True), (390, 844, True))  # the last two: a phone held sideways and upright
SLIDER, TOP_VIEW = "#frame", ".figure"
DRAWN = "figures.every(({ div }) => Math.hypot(div._fullLayout.width - div.clientWidth, div._fullLayout.height - div.clientHeight) < 2)"


MIDDLE = """(div, number) => {  // on the screen: the middle point of a trace; by itself of that of frames
    const { section } = figures.find((figure) => figure.div === div), layout = div._fullLayout;
    const space = layout.scene?._scene, box = (space?.container ?? div).getBoundingClientRect();
    const { x, y, z, xaxis, yaxis } = section.traces[number ?? section.frame_trace];
    const known = y.map((_, k) => k).filter((k) => y[k] !== null && x[k] !== null), k = known[Math.floor(known.length / 2)];
    if (!z) {
        const of = (name) => layout[name[0] + "axis" + name.slice(1)], [across, up] = [of(xaxis ?? "x"), of(yaxis ?? "y")];
        return [box.x + across._offset + across.d2p(x[k]), box.y + up._offset + up.d2p(y[k])];
    }
    const { glplot, dataScale } = space, { model, view, projection } = glplot.cameraParams;
    const times = (matrix, point) => [0, 1, 2, 3].map((row) => point.reduce((sum, value, column) => sum + matrix[4 * column + row] * value, 0));
    const [u, v, , w] = times(projection, times(view, times(model, [x[k] * dataScale[0], y[k] * dataScale[1], z[k] * dataScale[2], 1])));
    return [box.x + box.width * (1 + u / w) / 2, box.y + box.height * (1 - v / w) / 2]; }"""


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


def titles_in_the_way(page):
    """Those of axes that stand over another text or in a plot."""
    return page.evaluate("""figures.flatMap(({ div }) => {
        const elements = [...div.querySelectorAll("text, .nsewdrag")].map((element) => ({ element, box: element.getBoundingClientRect() }));
        const meet = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 2 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 2;
        return elements.filter(({ element, box }) => /^[xy][0-9]*title$/.test(element.getAttribute("class")) &&
            elements.some((other) => other.element !== element && meet(box, other.box))).map(({ element }) => element.textContent); })""")


def hard_to_read(page):
    """Texts that a figure's edge cuts, ticks upright or over each other, legends over plots, rows without a label."""
    return page.evaluate("""figures.flatMap(({ div }) => {
        const found = [], edge = div.getBoundingClientRect();
        const text_of = (element) => ({ text: element.textContent, element, box: element.getBoundingClientRect() });
        for (const { text, box } of [...div.querySelectorAll("text")].map(text_of))
            if (box.width > 0 && (box.left < edge.left - 1 || box.right > edge.right + 1 || box.top < edge.top - 1 || box.bottom > edge.bottom + 1))
                found.push("cut: " + text);
        const legend = div.querySelector(".legend")?.getBoundingClientRect(), plot = div.querySelector(".nsewdrag")?.getBoundingClientRect();
        if (legend && plot && legend.bottom > plot.top + 3) found.push("legend over the plot");
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


def buttons_over_legend(page):
    return page.evaluate("""figures.filter(({ div }) => {
        const legend = div.querySelector(".legend"), buttons = div.querySelector(".modebar");
        return legend && buttons.getBoundingClientRect().bottom > legend.getBoundingClientRect().top; }).map(({ section }) => section.heading)""")


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


def point_at_each(page, touch):
    """The label that each trace shows under the mouse or a finger, by heading and name; the traces that the slider does not follow."""
    labels, stays = {}, []
    seen = page.evaluate("""figures.flatMap(({ section }, i) => section.traces.flatMap(({ name, hoverinfo }, k) =>
        hoverinfo === "skip" ? [] : [[i, k, `${section.heading}, ${name}`]]))""")
    for i, number, heading in seen:
        figure = page.locator(".figure").nth(i)
        label = figure.locator(".hovertext, .hoverlayer .legend").first
        if not touch:  # where it points at the same frame again nothing would be told
            page.mouse.move(0, 0)
        page.evaluate("choose(0)")
        page.evaluate("(top) => scrollBy(0, top - 0.6 * innerHeight)", figure.evaluate(MIDDLE, number)[1])
        for nudge in (0, 1, -1):  # the first tap wakes a space
            x, y = figure.evaluate(MIDDLE, number)
            (page.touchscreen.tap if touch else page.mouse.move)(x + nudge, y)
            with contextlib.suppress(Late):
                label.wait_for(timeout=1500)
                break
        labels[heading] = label.text_content() if label.count() else ""
        with contextlib.suppress(Late):
            if figure.evaluate("(div) => follows_frames(figures.find((figure) => figure.div === div).section)"):
                stays.append(heading)
                page.wait_for_function("chosen > 0", timeout=5000)
                stays.pop()
    return labels, stays


def sizes_of_map(page):
    """How long both axes of the path from above are, and how long the paths."""
    return page.evaluate("""["x", "y"].map((axis) => {
        const { section, div } = figures[0], [low, high] = div._fullLayout[axis + "axis"].range;
        const values = section.traces.flatMap((trace) => trace[axis]).filter(Number.isFinite);
        return { axis: high - low, path: Math.max(...values) - Math.min(...values) }; })""")


def change_theme(page):
    """While the page is open: which figures and rings have not the ground's and the ink's colour."""
    page.emulate_media(color_scheme="dark")
    wrong = """(() => {
        const style = getComputedStyle(document.documentElement), colour = (name) => style.getPropertyValue(name).trim();
        return figures.filter(({ section, div }) => div._fullLayout.paper_bgcolor !== colour("--back") ||
            (follows_frames(section) && div._fullData.at(-1).marker.color !== colour("--ink"))).map(({ section }) => section.heading); })()"""
    with contextlib.suppress(Late):
        page.wait_for_function(f"matchMedia('(prefers-color-scheme: dark)').matches && {wrong}.length === 0", timeout=10000)
    return page.evaluate(wrong)


def use(page, found):
    """What a page with a slider over frames does by keyboard, mouse and wheel."""
    page.focus(SLIDER)
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    found["by_keyboard"] = page.locator("#frames output").text_content()
    found["images_under_the_slider"] = []
    for k in (0, 19, 20):
        page.evaluate(f"choose({k})")
        image = page.locator("#frames img")
        found["images_under_the_slider"].append([image.get_attribute("alt"), image.evaluate("(image) => image.decode().then(() => image.naturalWidth)")])

    page.mouse.move(*page.locator(TOP_VIEW).first.evaluate(MIDDLE))
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


def look(browser, report, screens, screenshots):
    found = {"errors": [], "requests": [], "screens": {}}
    page = open_page(browser, report, found, viewport={"width": 1280, "height": 900}, color_scheme="light")
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
    page.close()

    for width, height, touch in screens:
        page = open_page(browser, report, found, viewport={"width": width, "height": height}, color_scheme="light", has_touch=touch, is_mobile=touch)
        seen = {"width": page.evaluate("document.documentElement.scrollWidth"), "titles_in_the_way": titles_in_the_way(page),
                "hard_to_read": hard_to_read(page), "buttons_over_legend": buttons_over_legend(page), "at_edges_of_spaces": pixels_at_edges_of_spaces(page), "map": sizes_of_map(page)}
        page.set_viewport_size({"width": height, "height": width})  # turned, and back
        page.wait_for_timeout(1000)
        page.wait_for_function(DRAWN, timeout=20000)
        seen["titles_in_the_way"] += titles_in_the_way(page)
        seen["hard_to_read"] += hard_to_read(page)
        seen["buttons_over_legend"] += buttons_over_legend(page)
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_timeout(1000)
        page.wait_for_function(DRAWN, timeout=20000)
        seen["hard_to_read"] += hard_to_read(page)
        seen["labels"], seen["slider_stays"] = point_at_each(page, touch)
        if touch:
            seen["swiped"] = swipe(page)
        seen["wrong_colours"] = change_theme(page)
        seen["dark"] = page.evaluate("getComputedStyle(document.body).backgroundColor")
        found["screens"][str(width)] = seen
        if screenshots:
            page.screenshot(path=f"{screenshots}_{width}.png", full_page=True)
        page.close()
    return found


def main():
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=ARGUMENTS)
        options = [word for word in sys.argv[2:] if word != "--narrow"]
        found = look(browser, pathlib.Path(sys.argv[1]).resolve(), SCREENS[-1:] if "--narrow" in sys.argv else SCREENS, options[0] if options else None)
        browser.close()
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
