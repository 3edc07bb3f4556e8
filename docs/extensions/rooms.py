"""The directive ``rooms``: the picture of a package, and what each of its modules is for."""

import ast
from pathlib import Path
from typing import ClassVar

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

REPOSITORY = Path(__file__).parents[2]


def first_line(path: Path) -> str:
    """First line of a module's docstring, without its full stop; empty if it has none."""
    docstring = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return docstring.partition("\n\n")[0].replace("\n", " ").replace("``", "").rstrip(".")


def modules_of(package: str) -> dict[str, list[tuple[str, str]]]:
    """Modules of a package by the folder that they lie in, each with its first line."""
    folders: dict[str, list[tuple[str, str]]] = {}
    for path in sorted((REPOSITORY / package).rglob("*.py")):
        if path.stem not in {"__init__", "__main__"}:
            folder = path.parent.relative_to(REPOSITORY).as_posix()
            folders.setdefault(folder, []).append((path.stem, first_line(path)))
    return dict(sorted(folders.items()))


class Rooms(SphinxDirective):
    """All modules of one package, room by room."""

    required_arguments = 1
    has_content = False
    option_spec: ClassVar = {}

    def run(self) -> list[nodes.Node]:
        """A definition list for each folder of the package."""
        package = self.arguments[0]
        found: list[nodes.Node] = []
        picture = f"images/rooms_{package}.svg"
        if not (REPOSITORY / "docs" / picture).exists():
            raise self.error(f"there is no {picture}; `make images` draws it")
        said = f"The rooms of {package}; an arrow goes from a room to one that imports it"
        found.append(nodes.image(uri=f"/{picture}", alt=said, candidates={"*": picture}))
        self.env.images.add_file(self.env.docname, picture)
        for folder, modules in modules_of(package).items():
            listed = nodes.definition_list(classes=["rooms"])
            for name, line in modules:
                item = nodes.definition_list_item()
                item += nodes.term("", "", nodes.literal(text=name))
                item += nodes.definition("", nodes.paragraph(text=f"{line}."))
                listed += item
            found += [nodes.rubric(text=f"{folder}/"), listed]
        for path in (REPOSITORY / package).rglob("*.py"):
            self.env.note_dependency(str(path))
        return found


def setup(app: Sphinx) -> dict[str, bool]:
    """Make the directive known to Sphinx."""
    app.add_directive("rooms", Rooms)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
