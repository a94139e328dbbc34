"""Hatchling's hook for wheels: where there is a C compiler a wheel gets binaries, with a pure one beside it.

`SWARMTOUCH_PURE=1` makes the pure one alone. The hook runs before anything of ours is installed, so the sources
have to be put where Python finds them.
"""

import os
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from hatchling.builders.constants import BuildEnvVars
from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.builders.wheel import WheelBuilder, WheelBuilderConfig


class CompileHook(BuildHookInterface[WheelBuilderConfig]):
    """Adds the compiled form of what `pyproject.toml` lists."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        if self.root not in sys.path:
            sys.path.insert(0, self.root)
        self._place: tempfile.TemporaryDirectory[str] | None = None

    def dependencies(self) -> list[str]:
        """Returns what compiling needs: the group `compile`, and the packages whose types the sources use."""
        if not self._possible():
            return []
        project = tomllib.loads((Path(self.root) / "pyproject.toml").read_text(encoding="utf-8"))
        return [*project["dependency-groups"]["compile"], *self.metadata.core.dependencies]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compiles, and has the wheel named after this Python and platform; an editable one stays as it is."""
        if version != "standard" or not self._possible():
            return
        from deploy.compile.build import compile_modules  # noqa: PLC0415  not installed yet when this is imported
        from deploy.compile.recipe import CompileError, listed_modules  # noqa: PLC0415
        from shared.compiled import SHIPPED  # noqa: PLC0415

        root, place = Path(self.root), tempfile.TemporaryDirectory()
        try:
            compile_modules(root, listed_modules(root), Path(place.name), say=self.app.display_info)
        except CompileError as error:
            place.cleanup()
            self.app.display_warning(f"a pure wheel: {error}")
            return
        self._place = place
        build_data["force_include"][place.name] = SHIPPED
        build_data["pure_python"] = False
        build_data["infer_tag"] = True

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Makes the pure wheel beside a compiled one."""
        del version, build_data
        if self._place is None:
            return
        self._place.cleanup()
        self._place = None
        os.environ[BuildEnvVars.NO_HOOKS] = "true"
        try:
            pure = list(WheelBuilder(self.root).build(directory=str(Path(artifact_path).parent)))
        finally:
            del os.environ[BuildEnvVars.NO_HOOKS]
        self.app.display_info(f"and {pure[0]}")

    def _possible(self) -> bool:
        from deploy.compile.toolchain import missing  # noqa: PLC0415
        from shared.compiled import pure_is_asked_for  # noqa: PLC0415

        return not pure_is_asked_for() and not missing()
