"""Hydra's loader of configurations, which reads and merges the same files once in a process.

A composition takes Hydra a quarter of a second, most of it for the same files. A sweep composes a
configuration for itself and one for each kind of job.
"""

import pickle
from collections.abc import Hashable
from pathlib import Path
from typing import Any, ClassVar, cast

from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra._internal.config_repository import (
    CachingConfigRepository,
    ConfigRepository,
    IConfigRepository,
)
from hydra._internal.hydra import Hydra
from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.default_element import ResultDefault
from hydra.core.global_hydra import GlobalHydra
from hydra.core.object_type import ObjectType
from hydra.plugins.config_source import ConfigResult
from omegaconf import DictConfig


def start_hydra(name: str, path: ConfigSearchPath) -> Hydra:
    """Make Hydra's instance for a job of this name, with this search path."""
    hydra = Hydra(name, _Loader(path))
    GlobalHydra.instance().initialize(hydra)
    return hydra


class _Repository(ConfigRepository):
    """Hydra's repository, which parses a file again only if its text has changed.

    Attributes:
        contents: the source and the text of each file that was loaded, by its path in the
            configuration. Hydra copies the repository for each composition.
    """

    _parsed: ClassVar[dict[Hashable, bytes]] = {}

    def __init__(self, path: ConfigSearchPath) -> None:
        super().__init__(path)
        self.contents: dict[str, Hashable] = {}

    def load_config(self, config_path: str) -> ConfigResult | None:
        content = self._content(config_path)
        if content is None:
            return super().load_config(config_path)
        self.contents[config_path] = content
        if content in self._parsed:
            return cast(ConfigResult, _copy_of(self._parsed[content]))
        parsed = super().load_config(config_path)
        self._parsed[content] = pickle.dumps(parsed)
        return parsed

    def _content(self, config_path: str) -> Hashable | None:
        """Return a file's source and text; None if the configuration is elsewhere."""
        source = self._find_object_source(config_path, ObjectType.CONFIG)
        if source is None:
            return None
        text = None  # Hydra's own files don't change
        if source.scheme() == "file":
            name = source._normalize_file_name(config_path)
            text = Path(source.path, name).read_text(encoding="utf-8")
        elif source.provider != "hydra":
            return None
        return source.provider, source.path, config_path, text


class _Loader(ConfigLoaderImpl):
    """Hydra's loader, which merges the same configurations once."""

    _merged: ClassVar[dict[Hashable, bytes]] = {}

    def __init__(self, path: ConfigSearchPath) -> None:
        super().__init__(path)
        self.repository = _Repository(path)

    def _compose_config_from_defaults_list(
        self, defaults: list[ResultDefault], repo: IConfigRepository
    ) -> DictConfig:
        contents = cast(_Repository, cast(CachingConfigRepository, repo).delegate).contents
        paths = [str(default.config_path) for default in defaults]
        content = tuple(
            (path, default.package, default.primary, contents.get(path))
            for path, default in zip(paths, defaults, strict=True)
        )
        if content in self._merged:
            return cast(DictConfig, _copy_of(self._merged[content]))
        merged = super()._compose_config_from_defaults_list(defaults, repo)
        # Of what is in Hydra's store only these stay the same; from=… and others put theirs there.
        if {*paths} <= {"schema", "hydra/config", *contents}:
            self._merged[content] = pickle.dumps(merged)
        return merged


def _copy_of(kept: bytes) -> Any:
    """Return a copy of what was kept as bytes: `copy.deepcopy` takes seven times as long."""
    return pickle.loads(kept)  # noqa: S301  # bytes that this process has made
