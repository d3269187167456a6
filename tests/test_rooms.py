"""The order of the rooms, read off the import statements: imports go down only."""

import ast
import re
import subprocess
import sys
import tomllib
from functools import cache
from graphlib import TopologicalSorter
from importlib.metadata import packages_distributions
from importlib.util import resolve_name
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

ROOMS = [
    {"envs"},
    {"fnnq_torchrl.equations"},
    {"fnnq_torchrl.files"},
    {"fnnq_torchrl.config"},
    {"fnnq_torchrl.agent", "fnnq_torchrl.engine"},
    {"fnnq_torchrl.training"},
    {"hydra_plugins"},
    {"fnnq_torchrl.launch"},
    {"fnnq_torchrl.studies"},
    {"fnnq_torchrl"},
]
"""The rooms, from the bottom up. Rooms in one set don't import each other; the last is commands."""

# The only places that may import each library that is slow to load or belongs at the edge.
ONLY_IN = {
    "gymnasium": ["envs.gymnasium", "envs.from_gymnasium", "fnnq_torchrl.launch.registration"],
    "hydra": ["fnnq_torchrl.launch", "hydra_plugins"],
    "matplotlib": ["envs.pictures", "fnnq_torchrl.training.pictures.search"],
    "submitit": ["fnnq_torchrl.launch.cluster"],
    "mlflow": ["fnnq_torchrl.training.loggers.mlflow"],
    "optuna": ["fnnq_torchrl.launch.search", "fnnq_torchrl.training.pictures.search"],
    "sqlalchemy": ["fnnq_torchrl.training.loggers.mlflow"],
    "sklearn": ["fnnq_torchrl.training.memberships"],
    "pandas": ["fnnq_torchrl.studies.results.frame"],
    "PIL": ["fnnq_torchrl.training.loggers.tensorboard", "fnnq_torchrl.training.watching"],
    "jinja2": ["fnnq_torchrl.studies.report.page"],
    "vl_convert": ["fnnq_torchrl.studies.report.charts"],
    "wandb": ["fnnq_torchrl.training.loggers"],
}

# Libraries of an extra, imported only if the user asks for them.
OPTIONAL = {
    *("PIL", "gymnasium", "mlflow", "optuna", "sklearn", "sqlalchemy", "submitit"),
    *("jinja2", "markupsafe", "pandas", "tensorboard", "vl_convert", "wandb"),
}

PACKAGES = ("envs", "fnnq_torchrl", "hydra_plugins")


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {
    module_name(path): path
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
}


def lies_in(module: str, place: str) -> bool:
    return module == place or module.startswith(f"{place}.")


def room(module: str) -> str:
    places = [place for floor in ROOMS for place in floor if lies_in(module, place)]
    return max(places, key=len)


def floor(module: str) -> int:
    return next(height for height, floor in enumerate(ROOMS) if room(module) in floor)


@cache
def imports(module: str) -> frozenset[str]:
    """Return every name that the module imports, at its top or in a function.

    `from a.b import c` counts as a.b.c, since c may be a module; `own` finds its module.
    """
    package = module if FILES[module].name == "__init__.py" else module.rpartition(".")[0]
    names = set()
    for node in ast.walk(ast.parse(FILES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            source = resolve_name("." * node.level + (node.module or ""), package)
            names |= {f"{source}.{alias.name}" for alias in node.names}
    return frozenset(names)


def own(name: str) -> str | None:
    """Return the module of this repository that has an imported name, or None."""
    while name and name not in FILES:
        name = name.rpartition(".")[0]
    return name or None


def own_imports(module: str) -> set[str]:
    return {target for name in imports(module) if (target := own(name))} - {module}


def importers(library: str) -> set[str]:
    return {
        module for module in FILES if any(name.split(".")[0] == library for name in imports(module))
    }


@pytest.mark.parametrize("module", FILES)
def test_imports_go_down_only(module: str) -> None:
    above = {
        target
        for target in own_imports(module)
        if room(target) != room(module) and floor(target) >= floor(module)
    }
    assert not above


def test_no_import_cycle() -> None:
    TopologicalSorter({module: own_imports(module) for module in FILES}).prepare()


def test_at_the_top_of_the_package_there_are_rooms_and_commands_only() -> None:
    package = ROOT / "fnnq_torchrl"
    rooms = {place.partition(".")[2] for floor in ROOMS for place in floor} - {""}
    folders = {path.parent.name for path in package.glob("*/__init__.py")}
    assert folders == rooms
    commands = {path.stem for path in package.glob("*.py")} - {"__init__"}
    for command in commands:
        assert (
            'if __name__ == "__main__":\n    main()\n'
            in FILES[f"fnnq_torchrl.{command}"].read_text()
        )


@pytest.mark.parametrize("library", ONLY_IN)
def test_a_library_is_imported_in_its_place_only(library: str) -> None:
    places = ONLY_IN[library]
    assert not {
        module
        for module in importers(library)
        if not any(lies_in(module, place) for place in places)
    }


def test_the_declared_dependencies_are_what_is_imported() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = {re.split("[<>=]", requirement)[0] for requirement in project["dependencies"]}
    libraries = {name.split(".")[0] for module in FILES for name in imports(module)}
    libraries -= sys.stdlib_module_names | set(PACKAGES) | OPTIONAL
    distributions = packages_distributions()
    assert {distributions[library][0] for library in libraries} == declared


LIGHT = [
    "envs.core.parameters",
    "envs.robot.schemas",
    "fnnq_torchrl",
    "fnnq_torchrl.config.schema",
    "fnnq_torchrl.training.results",
    "fnnq_torchrl.studies.statistics",
]


def test_configuration_and_statistics_import_no_torch() -> None:
    script = f"import sys, {', '.join(LIGHT)}; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], cwd=ROOT, check=False).returncode == 0


def test_the_map_has_every_room() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    (rooms_map,) = re.findall(r"```\n(README\.md .*?)```", text, re.DOTALL)
    rooms = {path.parent.name for package in PACKAGES for path in (ROOT / package).rglob("*.py")}
    top = {path.name for path in ROOT.iterdir() if not path.name.startswith(".")} - {"dist"}
    assert not {name for name in rooms | top if name not in rooms_map}
