"""What a system of a lab's own is made of, loaded when first used.

A package names its system by an entry point in the group ``gtval.systems`` and its commands by
one in ``gtval.commands``; `System` says what a system must offer.
"""

from gtval.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true; importing typing costs more than the rest

if TYPE_CHECKING:
    from validation.campaign.folder import Campaign, Settings
    from validation.commands.solve import solve_command
    from validation.errors import GtvalError, InputError, Problem
    from validation.poses.pose_table import PoseTable
    from validation.results import Figure, Finding, Section, SystemResult, Table, Text
    from validation.systems import Progress, System
    from validation.text_files.csv_tables import Column, read_csv

__all__ = ["Campaign", "Settings", "solve_command"]
__all__ += ["GtvalError", "InputError", "Problem"]
__all__ += ["Column", "PoseTable", "read_csv"]
__all__ += ["Figure", "Finding", "Section", "SystemResult", "Table", "Text"]
__all__ += ["Progress", "System"]

__getattr__ = lazily(
    __name__,
    {
        "validation.campaign.folder": "Campaign Settings",
        "validation.commands.solve": "solve_command",
        "validation.errors": "GtvalError InputError Problem",
        "validation.poses.pose_table": "PoseTable",
        "validation.results": "Figure Finding Section SystemResult Table Text",
        "validation.systems": "Progress System",
        "validation.text_files.csv_tables": "Column read_csv",
    },
)


def __dir__() -> list[str]:
    """The names above, also before they are loaded."""
    return __all__
