"""The command's help page, made from the keys, defaults and comments of ``conf/``."""

import re
import shutil
import textwrap
from collections.abc import Iterator

from fnnq_torchrl.config.choices import choices_of, config_directory

_BEFORE = """\
fnnq-train [key=value …] [-m]

Trains runs of Peng's Q(λ) on a fuzzy neural network, which learns to steer a robot towards a
rolling ball, and tests them on the way. Results, weights and learning curves go into a new
directory below outputs/.

Examples
  fnnq-train lam=0.8 num_seeds=22                   22 runs with λ = 0.8, side by side
  fnnq-train lam=0,0.1,0.4,0.8 num_seeds=22 -m      a sweep: one job for each λ
  fnnq-train +experiment=fig2                       the sweep of the paper's figure 2
"""

_AFTER = """\

Flags
  -m, --multirun       sweep: a job for each combination of values
  --cfg job            show all keys with their values, and train nothing
  --config-dir DIR     look for choices of your own in DIR, as in DIR/experiment/mine.yaml
  from=DIR             take the configuration of the job in DIR; keys typed beside it change it
  --version            show the version
  --hydra-help         show Hydra's own flags

To continue an interrupted job or sweep, repeat its command with its directory, hydra.run.dir=DIR or
hydra.sweep.dir=DIR.
"""

_HEADING = re.compile(r"# -- (.*?) -+")
_KEY = re.compile(r"( *)(\w+):(?: ([^\s#]+))?(?: +# (.*))?")


def help_page() -> str:
    """Return the page, as wide as the terminal but 100 columns at most."""
    width = min(shutil.get_terminal_size((100, 24)).columns, 100)
    text = (config_directory() / "config.yaml").read_text(encoding="utf-8")
    return "".join([_BEFORE, *_keys(text, width), *_groups(width), _AFTER])


def _keys(text: str, width: int) -> Iterator[str]:
    """Yield the top-level keys of ``config.yaml`` in its order, with their comments.

    Args:
        text: the text of the file. A comment follows its key or is on the lines right above it.
        width: the columns of the page.
    """
    above: list[str] = []
    group, begun = "", False
    for line in text.splitlines():
        if line == "hydra:":
            return
        if heading := _HEADING.fullmatch(line):
            yield f"\nKeys: {heading[1]}\n"
            begun = True
        elif line.startswith("#"):
            above.append(line.removeprefix("#").strip())
            continue
        elif begun and (key := _KEY.fullmatch(line)):
            indent, name, default, comment = key.groups()
            group = group if indent else ""
            if default is None:
                group = f"{name}."
            else:
                words = " ".join([*above, comment or ""])
                yield _entry(f"{group}{name}={default}", words, width)
        above = []


def _groups(width: int) -> Iterator[str]:
    """Yield the groups of ``conf/`` with their choices."""
    yield "\nKeys that choose a file of conf/, which brings keys of its own\n"
    for folder in sorted(path.name for path in config_directory().iterdir() if path.is_dir()):
        if folder not in ("hydra", "tuned"):  # tuned is chosen by the task and the value function
            key = f"+{folder}=" if folder == "experiment" else f"{folder}="
            yield _entry(key, ", ".join(choices_of(folder)), width)


def _entry(key: str, words: str, width: int) -> str:
    indent = " " * 29
    first = f"  {key} ".ljust(len(indent))
    return textwrap.fill(words, width, initial_indent=first, subsequent_indent=indent) + "\n"
