"""Visit the page of `fnnq_torchrl.play` in Chromium, do what a reader does, print what is seen.

It runs in an environment of its own: python visit_play.py PAGE CHROMIUM
"""

from pathlib import Path
from typing import Any

from pages import main, visit, wait
from playwright.sync_api import Browser

READY = "globalThis.play?.robots.some((robot) => robot.trail.length > 2)"
STEPS = """(count) => {
    const { learned, step } = globalThis.play;
    const leaves = () => Object.fromEntries(
        Object.entries(learned.of).map(([name, of]) => [name, Array.from(of, String)]));
    const states = [leaves()];
    for (let n = 0; n < count; ++n) {
        learned.of["world/held"][0] = n < 5 ? 0 : 1;
        step(learned.leaf);
        states.push(leaves());
    }
    return states;
}"""
ACT = "(play.step(play.learned.leaf), play.learned.of.action[0])"


def act(browser: Browser, address: str) -> dict[str, Any]:
    """Drag the ball, press keys, change the rules, and download them."""
    page, complaints = visit(browser, address, READY)
    seen: dict[str, Any] = {"complaints": complaints}
    page.click("#pause")
    seen["states"] = page.evaluate(STEPS, 20)
    page.click("#restart")
    # A drag to the lower left corner of the second picture.
    box = page.locator("#after").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.1 * box["width"], box["y"] + 0.9 * box["height"], steps=5)
    page.mouse.up()
    seen["dragged"] = page.evaluate("({ ...play.ball })")
    page.click("#pause")
    wait(page, "play.learned.trail.length > 10")
    page.click("#pause")
    seen["turned"] = page.evaluate("play.learned.after[2]")
    page.focus("#after")
    page.keyboard.press("ArrowUp")
    seen["moved"] = page.evaluate("({ ...play.ball })")
    seen["actions"] = []
    for best in (0, 3):  # steering hard to the left is best everywhere, then hard to the right
        for column in range(4):
            for row in range(5):
                cell = page.locator("#grid tbody tr").nth(row).locator("input").nth(column)
                cell.fill("1" if column == best else "0")
        acted = page.evaluate("(play.step(play.learned.leaf), play.learned.of.action[0])")
        seen["actions"].append(acted)
    seen["files"] = {}
    for name in ("rules.txt", "rules.fll", "rules.c", "rules.h"):
        with page.expect_download() as waiting:
            page.get_by_role("button", name=name, exact=True).click()
        seen["files"][name] = Path(waiting.value.path()).read_text()
    return seen


if __name__ == "__main__":
    main(act, READY)
