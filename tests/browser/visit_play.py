"""Visit the page of `fnnq_torchrl.play` in Chromium, do what a reader does, print what is seen.

It runs in an environment of its own: python visit_play.py PAGE CHROMIUM
"""

from pathlib import Path
from typing import Any

from pages import main, visit, wait
from playwright.sync_api import Browser, Page

READY = "globalThis.play?.robots.some((robot) => robot.trail.length > 2)"
STEPS = """(count) => {
    const { learned, step, shared, data } = globalThis.play;
    const leaves = () => Object.fromEntries(
        Object.entries(learned.of).map(([name, of]) => [name, Array.from(of, String)]));
    const pairs = [];
    for (let n = 0; n < count; ++n) {
        learned.of["world/held"]?.fill(n < 5 ? 0 : 1);
        if (n === 10) learned.of["world/speed_mps"][0] = 0.2;
        if (n === 10) learned.of[`world/${data.scene.noise}`][0] *= 3;
        const before = leaves();
        step(learned.leaf);
        pairs.push([before, leaves()]);
    }
    return pairs;
}"""


def act(browser: Browser, address: str) -> dict[str, Any]:
    """Drag the ball and an obstacle, press keys, change the rules, and download them."""
    page, complaints = visit(browser, address, READY)
    seen: dict[str, Any] = {"complaints": complaints}
    page.click("#pause")
    seen["steps"] = page.evaluate(STEPS, 20)
    page.click("#next")
    page.reload()
    wait(page, READY)
    page.click("#pause")
    page.click("#restart")
    if page.evaluate("'disc_x_m' in play.shared"):
        start = page.evaluate("[play.shared.disc_x_m[0], play.shared.disc_y_m[0]]")
        drag(page, start, [0.8, 0.0])
        seen["disc"] = page.evaluate("[play.shared.disc_x_m[0], play.shared.disc_y_m[0]]")
        page.click("#restart")
        seen["front_m"] = page.evaluate("play.learned.of['world/sonar_front_m'][0]")
    half = page.evaluate("play.learned.reach")
    drag(page, [0, 0], [-0.8 * half, 0.8 * half])  # to the lower left corner
    seen["half"], seen["dragged"] = half, shared(page)
    page.click("#pause")
    wait(page, "play.learned.trail.length > 10")
    page.click("#pause")
    seen["pose"] = page.evaluate("play.learned.after")
    page.focus("#after")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Enter")
    page.keyboard.press("ArrowDown")
    seen["moved"] = shared(page)
    seen["actions"] = []
    cells = page.locator("#grid tbody input")
    if cells.count() > 20:
        return seen
    for best in (0, 3):  # steering hard to the left is best everywhere, then hard to the right
        for number in range(20):
            cells.nth(number).fill("1" if number % 4 == best else "0")
        acted = page.evaluate("(play.step(play.learned.leaf), play.learned.of.action[0])")
        seen["actions"].append(acted)
    seen["files"] = {}
    for name in ("rules.txt", "rules.fll", "rules.c", "rules.h"):
        with page.expect_download() as waiting:
            page.get_by_role("button", name=name, exact=True).click()
        seen["files"][name] = Path(waiting.value.path()).read_text()
    return seen


def drag(page: Page, start: list[float], end: list[float]) -> None:
    """Drag from a place to another, both x and y in m, in the picture of the learned robot."""
    box, half = page.locator("#after").bounding_box(), page.evaluate("play.learned.reach")
    assert box is not None

    def pixels(place: list[float]) -> tuple[float, float]:
        ahead, left = (0.5 - part / (2 * half) for part in place)
        return box["x"] + left * box["width"], box["y"] + ahead * box["height"]

    page.mouse.move(*pixels(start))
    page.mouse.down()
    page.mouse.move(*pixels(end), steps=5)
    page.mouse.up()


def shared(page: Page) -> dict[str, list[float]]:
    """Return the state of the objects."""
    found: dict[str, list[float]] = page.evaluate("({ ...play.shared })")
    return found


if __name__ == "__main__":
    main(act, READY)
