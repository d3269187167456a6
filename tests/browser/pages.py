"""Visits to a page in Chromium, in the environment that `make browser` makes."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, sync_playwright

FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
VIEWS = [(1200, "light"), (1200, "dark"), (360, "light"), (360, "dark")]
"""The widths in pixels and the colour schemes in which each page is looked at."""


def visit(
    browser: Browser, address: str, ready: str, width: int = 1200, scheme: str = "light"
) -> tuple[Page, list[str]]:
    """Open the page without a network; return it, and its complaints so far and later.

    Args:
        browser: the browser.
        address: the address of the page.
        ready: an expression in JavaScript that is true once the page is ready.
        width: the width of the window in pixels.
        scheme: the reader's colour scheme.
    """
    context = browser.new_context(
        viewport={"width": width, "height": 900}, color_scheme=scheme, offline=True
    )
    page, complaints = context.new_page(), list[str]()
    page.on("console", lambda told: complaints.append(told.text) if told.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on(
        "request",
        lambda asked: complaints.append(asked.url) if asked.url.startswith("http") else None,
    )
    page.goto(address)
    wait(page, ready)
    return page, complaints


def wait(page: Page, condition: str) -> None:
    """Wait until an expression in JavaScript is true, for at most half a minute.

    Playwright's own way evaluates texts in the page, which the report's policy forbids.
    """
    page.evaluate(
        f"""new Promise((done, fail) => {{
            setTimeout(() => fail(new Error({json.dumps(condition)})), 30000);
            const look = () => (({condition}) ? done() : requestAnimationFrame(look));
            look();
        }})"""
    )


def look(browser: Browser, address: str, ready: str) -> dict[str, Any]:
    """Return what is wrong with the page in any of the views."""
    seen: dict[str, Any] = {"complaints": [], "violations": [], "widths": []}
    for width, scheme in VIEWS:
        page, complaints = visit(browser, address, ready, width, scheme)
        found = Axe().run(page).response["violations"]
        seen["violations"] += [
            each["id"] for each in found if each["impact"] in ("serious", "critical")
        ]
        seen["widths"] += [page.evaluate("document.documentElement.scrollWidth - innerWidth")]
        seen["complaints"] += complaints
        page.context.close()
    return seen


def main(act: Callable[[Browser, str], dict[str, Any]], ready: str) -> None:
    """Look at the page that the arguments name, do what a reader does, print what is seen.

    Args:
        act: a function from the browser and the page's address to what is seen.
        ready: as in :func:`visit`.
    """
    address, chromium = Path(sys.argv[1]).absolute().as_uri(), sys.argv[2]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        seen = look(browser, address, ready)
        acted = act(browser, address)
        seen["complaints"] += acted.pop("complaints")
        browser.close()
    print(json.dumps(seen | acted))
