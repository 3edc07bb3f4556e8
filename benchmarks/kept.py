"""Every benchmark in turn, its figures beside those that were kept last.

    python benchmarks/kept.py [--keep] [SCRIPT ...]

A figure is a number in a line that a benchmark prints; it is known by the words of that line. With
--keep the figures are added to figures.json with date, machine and versions, so that a regression
shows the next time: the ratio of each figure to the last one kept is printed where it differs by
more than a fifth. Times depend on the machine, so that figures of another machine are not compared.
"""

import argparse
import json
import os
import platform
import re
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

HERE = Path(__file__).parent
KEPT = HERE / "figures.json"
NOT_BENCHMARKS = {"kept.py", "process_time.py"}
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\d)")
DIFFERENT = 1.2
"""Whole processes on a machine that others use differ by up to a fifth from run to run."""
LIBRARIES = ("gtval", "numpy", "scipy", "opencv-contrib-python-headless")


def figures_of(printed: str) -> dict[str, float]:
    """Every number printed, by the words of its line and its place among the line's numbers."""
    found: dict[str, float] = {}
    for line in printed.splitlines():
        words = " ".join(NUMBER.sub("#", line).split())
        for place, number in enumerate(NUMBER.findall(line)):
            name = f"{words} [{place}]"
            while name in found:
                name += "'"
            found[name] = float(number)
    return found


def machine() -> dict[str, object]:
    """What times depend on."""
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "processors": os.cpu_count(),
        "python": platform.python_version(),
    }


def measured(script: Path) -> dict[str, float]:
    """The figures that a benchmark prints; its output goes on to the terminal."""
    print(f"== {script.name}", flush=True)
    started = time.perf_counter()
    done = subprocess.run([sys.executable, script], check=True, capture_output=True, text=True)
    print(done.stdout, end="")
    print(f"({time.perf_counter() - started:.0f} s)", flush=True)
    return figures_of(done.stdout)


def last_kept(records: list[dict], script: str) -> dict[str, float]:
    """The newest figures of a benchmark on a machine like this one."""
    for record in reversed(records):
        if record["machine"] == machine() and script in record["figures"]:
            return record["figures"][script]
    return {}


def show_ratios(now: dict[str, float], before: dict[str, float]) -> None:
    """Print what differs from the last figures kept."""
    both = {name: (now[name], before[name]) for name in now if before.get(name)}
    changed = {
        name: (one, was)
        for name, (one, was) in both.items()
        if not 1 / DIFFERENT <= one / was <= DIFFERENT
    }
    print(f"   {len(both)} figures were kept before; {len(changed)} differ by more than a fifth")
    for name, (one, was) in changed.items():
        print(f"   {one / was:6.2f} times  {was:g} -> {one:g}  {name}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--keep", action="store_true", help="add the figures to figures.json")
    parser.add_argument("scripts", nargs="*", help="names of benchmarks; all by default")
    options = parser.parse_args()
    names = options.scripts or sorted(
        path.name for path in HERE.glob("*.py") if path.name not in NOT_BENCHMARKS
    )
    records = json.loads(KEPT.read_text()) if KEPT.exists() else []
    figures = {}
    for name in names:
        figures[name] = measured(HERE / name)
        show_ratios(figures[name], last_kept(records, name))
    if options.keep:
        record = {
            "date": time.strftime("%Y-%m-%d"),
            "machine": machine(),
            "versions": {library: version(library) for library in LIBRARIES},
            "figures": figures,
        }
        KEPT.write_text(json.dumps([*records, record], indent=1) + "\n")


if __name__ == "__main__":
    main()
