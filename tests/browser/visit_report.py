"""Visit the page of `fnnq_torchrl.report` in Chromium, do what a reader does, print what is seen.

It runs in an environment of its own: python visit_report.py PAGE CHROMIUM
"""

from typing import Any

from pages import main, visit, wait
from playwright.sync_api import Browser

READY = "globalThis.report?.drawn > 0"
CHARTS = """[...document.querySelectorAll("[data-chart]")].map((place) => ({
    title: place.parentElement.querySelector("figcaption").textContent,
    marks: place.querySelectorAll("svg .mark-line path, svg .mark-rect path").length,
    width: place.querySelector("svg").getBoundingClientRect().width,
    room: place.clientWidth,
}))"""
LIT = """[...document.querySelectorAll("[data-rule]")]
    .filter((cell) => cell.style.getPropertyValue("--fired") > 0.01)
    .map((cell) => Number(cell.dataset.rule))"""
IN_VIEW = """[...document.querySelectorAll("[data-rule]")].some((cell) => {
    const box = cell.closest(".scroll").getBoundingClientRect();
    const { top, bottom } = cell.getBoundingClientRect();
    return cell.style.getPropertyValue("--fired") > 0.3 && top >= box.top && bottom <= box.bottom;
})"""
PICTURE = "document.getElementById('world').toDataURL()"
COLOUR = "getComputedStyle(document.querySelector('svg text')).fill"


def act(browser: Browser, address: str) -> dict[str, Any]:
    """Play the replay, choose a situation, and change the colour scheme."""
    page, complaints = visit(browser, address, READY, 360)
    seen: dict[str, Any] = {"complaints": complaints, "narrow": page.evaluate(CHARTS)}
    page, more = visit(browser, address, READY)
    seen["charts"] = page.evaluate(CHARTS)
    seen["start"], before = page.evaluate("({ ...report.moment })"), page.evaluate(PICTURE)
    page.click("#go")
    wait(page, f"report.moment.at > {seen['start']['at'] + 2}")
    page.click("#go")
    seen["moved"] = page.evaluate(PICTURE) != before
    page.focus("#at")
    page.keyboard.press("Home")
    page.keyboard.press("ArrowRight")
    seen["pressed"] = page.evaluate("({ ...report.moment })")
    seen["lit"], seen["lit_in_view"] = page.evaluate(LIT), page.evaluate(IN_VIEW)
    page.select_option("#situation", "2")
    seen["chosen"] = page.evaluate("({ ...report.moment })")
    seen["words"] = page.inner_text("#now")
    page.select_option("#phase", "before")
    seen["lit_before_learning"] = page.evaluate(LIT)
    seen["endings"] = page.locator("#situation option").all_inner_texts()
    light = page.evaluate(COLOUR)
    page.emulate_media(color_scheme="dark")
    wait(page, "report.drawn > 1")
    seen["text_changes_its_colour"] = page.evaluate(COLOUR) != light
    seen["complaints"] = complaints + more
    # Even if a text became an element, its script would not run.
    page.evaluate("document.body.insertAdjacentHTML('beforeend', '<svg onload=\"hacked = 1\">')")
    page.evaluate(
        "const script = document.createElement('script'); script.text = 'hacked = 1';"
        "document.body.append(script)"
    )
    page.evaluate("new Promise((done) => setTimeout(done, 50))")
    seen["hacked"] = page.evaluate("'hacked' in globalThis")
    return seen


if __name__ == "__main__":
    main(act, READY)
