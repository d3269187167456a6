"""Play with a learned controller in the browser: ``python -m fnnq_torchrl.play run=DIR``.

The page is served at 127.0.0.1, which only this machine can reach, until you press Ctrl-C.

Keys, each as key=value:

    run     the directory of a finished job of task=follow, follow_obstacles or wander
    seed    the seed of one of the job's runs (default: that of the best run)
    to      a file to which the page is written, instead of being served
    port    the port at which the page is served (default: any free one)
    own     true: import the classes of your own that the job's configuration names (default: false)
"""

import sys
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

from fnnq_torchrl.launch.arguments import one_line_errors
from fnnq_torchrl.launch.words import parse, truth, whole

_DEFAULTS = {"run": "", "seed": "", "to": "", "port": "0", "own": "false"}


def main() -> None:
    """Run the command; an error is one line on stderr and an exit status other than 0."""
    if {"-h", "--help"} & {*sys.argv[1:]}:
        sys.stdout.write(__doc__ or "")
        return
    with one_line_errors():
        _run(_DEFAULTS | parse(sys.argv[1:], _DEFAULTS, ["run"]))


def _run(given: dict[str, str]) -> None:
    port = whole(given, "port", low=0)
    seed = whole(given, "seed", low=0) if given["seed"] else None
    own = truth("own", given["own"])
    # Imported after the checks, because importing torch takes seconds.
    from fnnq_torchrl.files.atomic import atomic_write
    from fnnq_torchrl.studies.play.page import make_page

    page = make_page(Path(given["run"]), seed, own=own).encode()
    if given["to"]:
        with atomic_write(Path(given["to"])) as file:
            file.write(page)
        sys.stdout.write(f"{given['to']}\n")
        return
    with make_server(page, port) as server:
        host, at = server.server_address[:2]
        sys.stdout.write(f"open http://{host!s}:{at} in a browser; Ctrl-C ends this\n")
        sys.stdout.flush()
        with suppress(KeyboardInterrupt):
            server.serve_forever()


def make_server(page: bytes, port: int = 0) -> HTTPServer:
    """Return a server of one page at 127.0.0.1, which other machines can't reach.

    Args:
        page: the page, HTML in UTF-8.
        port: the port; 0 for any free one.

    Raises:
        OSError: if the port is taken.
    """

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            found = self.path == "/"
            self.send_response(200 if found else 404)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(page) if found else 0))
            self.end_headers()
            self.wfile.write(page if found else b"")

        def log_message(self, *_: object) -> None:
            """Log no requests."""

    return HTTPServer(("127.0.0.1", port), Handler)
