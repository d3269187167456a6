"""The architecture, read off the import statements: a module imports from its floor and below."""

import ast
import re
import subprocess
import sys
import tomllib
from graphlib import TopologicalSorter
from importlib.metadata import packages_distributions
from importlib.util import resolve_name
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# A package stands for all its modules.
FLOORS = {
    "envs": 0,
    "fnnq_torchrl": 0,
    "fnnq_torchrl.arguments": 0,
    "fnnq_torchrl.atomic": 0,
    "fnnq_torchrl.batches": 1,
    "fnnq_torchrl.choices": 0,
    "fnnq_torchrl.config": 0,
    "fnnq_torchrl.denormals": 0,
    "fnnq_torchrl.interruptions": 0,
    "fnnq_torchrl.lanes": 0,
    "fnnq_torchrl.layout": 0,
    "fnnq_torchrl.logger_config": 0,
    "fnnq_torchrl.loops": 0,
    "fnnq_torchrl.membership": 0,
    "fnnq_torchrl.plain": 1,
    "fnnq_torchrl.stats": 0,
    "fnnq_torchrl.threads": 0,
    "fnnq_torchrl.value_config": 0,
    "fnnq_torchrl.autograd": 1,
    "fnnq_torchrl.effective_step": 1,
    "fnnq_torchrl.step_size": 1,
    "fnnq_torchrl.exploration": 1,
    "fnnq_torchrl.graphs": 1,
    "fnnq_torchrl.qlambda": 1,
    "fnnq_torchrl.values": 1,
    "fnnq_torchrl.loss": 2,
    "fnnq_torchrl.policy": 2,
    "fnnq_torchrl.results": 2,
    "fnnq_torchrl.adaptive": 3,
    "fnnq_torchrl.checkpoint": 3,
    "fnnq_torchrl.cluster": 3,
    "fnnq_torchrl.engine": 3,
    "fnnq_torchrl.evaluation": 3,
    "fnnq_torchrl.experiments": 3,
    "fnnq_torchrl.extrapolation": 3,
    "fnnq_torchrl.figures": 3,
    "fnnq_torchrl.measures": 3,
    "fnnq_torchrl.inductor": 3,
    "fnnq_torchrl.job": 3,
    "fnnq_torchrl.keeper": 3,
    "fnnq_torchrl.learning": 3,
    "fnnq_torchrl.ledger": 3,
    "fnnq_torchrl.loggers": 3,
    "fnnq_torchrl.memory": 3,
    "fnnq_torchrl.native": 3,
    "fnnq_torchrl.program": 3,
    "fnnq_torchrl.report": 3,
    "fnnq_torchrl.saved": 3,
    "fnnq_torchrl.reproduction": 3,
    "fnnq_torchrl.snapshot_file": 3,
    "fnnq_torchrl.snapshots": 3,
    "fnnq_torchrl.sweep": 3,
    "fnnq_torchrl.trainer": 3,
    "fnnq_torchrl.work": 3,
    "fnnq_torchrl.adaptive.__main__": 4,
    "fnnq_torchrl.cli": 4,
    "fnnq_torchrl.compose": 4,
    "fnnq_torchrl.extrapolation.__main__": 4,
    "fnnq_torchrl.figures.__main__": 4,
    "fnnq_torchrl.reproduction.__main__": 4,
    "fnnq_torchrl.flags": 4,
    "fnnq_torchrl.launcher": 4,
    "fnnq_torchrl.multirun": 4,
    "fnnq_torchrl.train": 4,
    "hydra_plugins.fnnq_torchrl": 4,
}
# Who may import what is slow to load, or belongs at the edge.
ONLY_IN = {
    "gymnasium": {"envs.gymnasium_face"},
    "hydra": {name for name, height in FLOORS.items() if height == 4},
    "matplotlib": {
        f"fnnq_torchrl.figures{module}"
        for module in ("", ".curves", ".dots", ".gallery", ".lines", ".readings", ".style")
    }
    | {"fnnq_torchrl.extrapolation.pictures"},
    "submitit": {"fnnq_torchrl.cluster"},
    "mlflow": {"fnnq_torchrl.loggers.mlflow"},
    "PIL": {"fnnq_torchrl.loggers.tensorboard"},
    "wandb": {"fnnq_torchrl.loggers.wandb", "fnnq_torchrl.loggers.wandb_file"},
}


# Of an extra, and imported only where a user asks for it.
OPTIONAL = {"PIL", "gymnasium", "mlflow", "submitit", "wandb"}


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


PACKAGES = ("envs", "fnnq_torchrl", "hydra_plugins")
FILES = {
    module_name(path): path
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
}


def floor(module: str) -> int:
    name = module
    while name not in FLOORS:
        name = name.rpartition(".")[0]
        if name in ("", "fnnq_torchrl"):
            pytest.fail(f"{module} has no floor: list it in FLOORS")
    return FLOORS[name]


def imports(module: str) -> set[str]:
    """Every name that the module's file imports, at its top or later: modules and what is in them.

    `from a.b import c` counts as a.b.c, since c may be a module; `own` tells which it is.
    """
    package = module if FILES[module].name == "__init__.py" else module.rpartition(".")[0]
    names = set()
    for node in ast.walk(ast.parse(FILES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            source = resolve_name("." * node.level + (node.module or ""), package)
            names |= {f"{source}.{alias.name}" for alias in node.names}
    return names


def own(name: str) -> str | None:
    """The module of ours that an imported name lies in, or None."""
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
    highest = floor(module)
    assert not {target for target in own_imports(module) if floor(target) > highest}


def test_no_import_cycle() -> None:
    TopologicalSorter({module: own_imports(module) for module in FILES}).prepare()


def test_the_world_knows_nothing_of_learning() -> None:
    assert not {module for module in importers("fnnq_torchrl") if module.startswith("envs")}


@pytest.mark.parametrize("library", ONLY_IN)
def test_a_library_is_imported_in_its_place_only(library: str) -> None:
    assert importers(library) <= ONLY_IN[library]


def test_every_listed_floor_has_a_module() -> None:
    assert FLOORS.keys() <= FILES.keys()


def test_the_declared_dependencies_are_what_is_imported() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = {re.split("[<>=]", requirement)[0] for requirement in project["dependencies"]}
    libraries = {name.split(".")[0] for module in FILES for name in imports(module)}
    libraries -= sys.stdlib_module_names | set(PACKAGES) | OPTIONAL
    distributions = packages_distributions()
    assert {distributions[library][0] for library in libraries} == declared


LIGHT = [
    "envs.ranges",
    "envs.world",
    "fnnq_torchrl.config",
    "fnnq_torchrl.results",
    "fnnq_torchrl.stats",
]


def test_configuration_and_statistics_import_no_torch() -> None:
    script = f"import sys, {', '.join(LIGHT)}; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], cwd=ROOT, check=False).returncode == 0
