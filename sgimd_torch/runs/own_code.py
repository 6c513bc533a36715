"""The files of code that is the user's own: a part's module, and what it imports from beside it.

checksums = {name: checksum(path) for name, path in sources_of(["lab.arm:Arm"])}
"""

from __future__ import annotations

import ast
import importlib.util
from collections.abc import Iterable, Iterator
from pathlib import Path


def sources_of(words: Iterable[str]) -> Iterator[tuple[str, Path]]:
    """The file of each part, and those of the modules that it imports from its own folder, or that of its package.

    Args:
        words: places of the parts, ``package.module:attribute``.
    """
    for word in words:
        module = word.partition(":")[0]
        spec = importlib.util.find_spec(module)
        if spec is None or not spec.has_location or not spec.origin:
            continue
        file = Path(spec.origin)
        folder = file.parents[module.count(".") + (file.name == "__init__.py")]
        files = {word: file}
        if file.suffix == ".py" and not {"site-packages", "dist-packages"} & {*file.parts}:  # else it has a version
            _add_imported(module, file, folder, files)
        yield from files.items()


def _add_imported(module: str, file: Path, folder: Path, files: dict[str, Path]) -> None:
    """Add to ``files`` those in ``folder`` that a module imports, inside functions too, and what these import."""
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    names = list[str]()
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            origin = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            names += [origin, *(f"{origin}.{alias.name}" for alias in node.names)]
    for name in names:
        if name.partition(".")[0] == "sgimd_torch":  # it has a version
            continue
        path = folder.joinpath(*name.split("."))
        for imported in (path.with_suffix(".py"), path / "__init__.py"):
            if imported.is_file() and imported not in files.values():
                files[name] = imported
                _add_imported(name, imported, folder, files)
