"""The blocks of code of a page, and running them as a reader would: from top to bottom.

A block of ``console`` is run line by line: what follows ``$`` is a command, other lines are what
it prints, where ``...`` stands for anything. A block of ``python`` is executed, all of a page in
one name space. A block of ``toml`` must be readable. A comment directly before a block may say
more, one thing a line:

``<!-- file: PATH -->``
    The block is the content of that file.
``<!-- append: PATH -->``
    The block is added to the end of that file.
``<!-- status: N -->``
    The last command ends with exit status N.
``<!-- setup: COMMAND -->``
    Is run before the block and not shown: it makes what the page says that the reader has.
``<!-- not run: REASON -->``
    The block is not run. The reason is one of `REASONS`.
``<!-- full -->``
    The page is run from here on in ``make test-full`` only, as it takes long.
"""

import os
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

from markdown_it import MarkdownIt

REPOSITORY = Path(__file__).parents[2]
PAGES = sorted(
    [
        *REPOSITORY.glob("*.md"),
        *(REPOSITORY / "docs").rglob("*.md"),
    ]
)
REASONS = {
    "installs packages",
    "waits for a person",
    "changes this shell",
    "runs on a server",
    "calls the test suite itself",
}
"""Why a block may be left out."""
RUN = {"console", "python", "toml"}
NOT_CODE = {"text", "csv", "yaml", "json"}
"""Languages of blocks that nothing can execute; ``csv`` and ``json`` must still be readable."""
_COMMENT = re.compile(
    r"<!--\s*(file|append|status|setup|not run|full)(?::\s*(.*?))?\s*-->", re.DOTALL
)


@dataclass(frozen=True)
class Block:
    """A block of a page."""

    page: Path
    line: int
    language: str
    text: str
    marks: list[tuple[str, str]] = field(default_factory=list)

    def mark(self, name: str) -> str | None:
        """What a mark says, None where there is none of that name."""
        return next((value for mark, value in self.marks if mark == name), None)

    @property
    def place(self) -> str:
        """Where the block is, for messages."""
        return f"{self.page.relative_to(REPOSITORY)}, line {self.line}"


def blocks_of(page: Path) -> list[Block]:
    """All blocks of a page in their order; those of MyST directives are left out."""
    found, marks = [], []
    for token in MarkdownIt("commonmark").enable("table").parse(page.read_text(encoding="utf-8")):
        if token.type == "html_block":
            marks += [(name, value) for name, value in _COMMENT.findall(token.content)]
        elif token.type in {"fence", "code_block"}:
            language = token.info.split()[0] if token.info.strip() else ""
            if not language.startswith("{"):
                line = (token.map or [0])[0] + 1
                found.append(Block(page, line, language, token.content, marks))
            marks = []
        elif marks and token.type.endswith("_open"):
            raise AssertionError(f"{page}: the comment {marks} stands before no block")
    return found


class Reader:
    """Somebody who does what a page says, in a fresh folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.names: dict[str, object] = {"__name__": "__main__"}
        binaries = str(Path(sys.executable).parent)
        self.environment = {
            **os.environ,
            "PATH": f"{binaries}{os.pathsep}{os.environ['PATH']}",
            "HOME": str(folder),
            "COLUMNS": "80",
            "MPLBACKEND": "Agg",
            "PYTHONWARNINGS": "error",
        }

    def follow(self, block: Block) -> None:
        """Do what one block says."""
        for name, command in block.marks:
            if name == "setup":
                status, printed = self._run(command)
                assert status == 0, f"{block.place}, setup: {command}\n{printed}"
        if block.mark("not run") is not None:
            return
        for name in ("file", "append"):
            path = block.mark(name)
            if path is not None:
                self._write(self.folder / path, block.text, append=name == "append")
                if not path.endswith(".py"):
                    return
        if block.language == "console":
            self._console(block)
        elif block.language == "python":
            exec(compile("\n" * block.line + block.text, str(block.page), "exec"), self.names)
        elif block.language == "toml":
            tomllib.loads(block.text)

    def _write(self, path: Path, text: str, *, append: bool) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        before = path.read_text(encoding="utf-8") if append else ""
        path.write_text(before + text, encoding="utf-8")

    def _console(self, block: Block) -> None:
        commands = commands_of(block)
        assert commands, f"{block.place}: no line begins with '$ '"
        for number, (command, expected) in enumerate(commands, 1):
            wanted = int(block.mark("status") or 0) if number == len(commands) else 0
            status, printed = self._run(command)
            said = f"{block.place}: {command}\nended with {status}, not {wanted}:\n{printed}"
            assert status == wanted, said
            if expected:
                assert _matches(expected, printed), f"{block.place}: {command}\n{printed}"

    def _run(self, command: str) -> tuple[int, str]:
        done = subprocess.run(
            ["bash", "-eu", "-o", "pipefail", "-c", command],
            cwd=self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            check=False,
        )
        return done.returncode, done.stdout.decode("utf-8", errors="replace")


def commands_of(block: Block) -> list[tuple[str, str]]:
    """Commands of a console block, each with what it is shown to print."""
    commands: list[tuple[str, str]] = []
    lines = iter(block.text.splitlines())
    for line in lines:
        if line.startswith("$ "):
            command = line[2:]
            while command.endswith("\\"):
                command = f"{command[:-1].rstrip()} {next(lines).strip()}"
            commands.append((command, ""))
        elif commands:
            command, expected = commands[-1]
            commands[-1] = (command, f"{expected}{line}\n")
        else:
            raise AssertionError(f"{block.place}: output before the first command")
    return commands


def _matches(expected: str, printed: str) -> bool:
    """Whether a text is what was shown; '...' stands for anything, blanks count once."""
    parts = [re.escape(" ".join(part.split())) for part in expected.split("...")]
    return re.search(".*".join(parts), " ".join(printed.split()), re.DOTALL) is not None
