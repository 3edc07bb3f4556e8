"""Examples of the [vision] tables of campaign.toml, to change."""

from collections.abc import Collection

_BOARD = "columns = 10, rows = 6, square = 0.1"
EXAMPLES = {
    "vision": {"board": f"{{ {_BOARD} }}"},
    "vision.bar": {
        "first": f'{{ {_BOARD}, family = "4X4_100" }}',
        "second": f'{{ {_BOARD}, family = "4X4_100", first_id = 30 }}',
        "second_on_first": "{ translation = [1.5, 0.0, 0.0] }",
    },
    "vision.reference": {"board": f"{{ {_BOARD} }}", "position": "[0.2, 0.0]"},
    "vision.markers": {
        "family": '"ARTOOLKITPLUS_SIMPLE"',
        "sides": '{ "3" = 0.156, "6" = 0.156, "14" = 0.160, "30" = 0.156 }',
        "dima": "14",
        "dima_on_robot": "{ translation = [-0.143, 0.098, 0.018], "
        "rotation = [[0, -1, 0], [1, 0, 0], [0, 0, 1]] }",
    },
    "vision.plan": {
        "resolution": "[1280, 960]",
        "field_of_view_deg": "65.0",
        "marker_side": "0.156",
        "marker_height": "0.5",
    },
    "vision.table": {
        "board": f"{{ {_BOARD} }}",
        "height": "0.72",
        "corner": "[0.0, 0.0]",
        "marker_side": "0.16",
        "marker_middle": "[0.4, 0.1]",
    },
    "vision.survey_check": {
        "board": f"{{ {_BOARD} }}",
        "places": "{ origin = { corner = [0.1, 0.1] } }",
    },
    "vision.displacement": {"distance": "0.6"},
}
"""A value for each key that states a lab's hardware, by table: none of them has a default."""


PLAN_EXAMPLE = """\
[vision.plan]
resolution = [1280, 960]
field_of_view_deg = 65.0    # across the image
marker_side = 0.156
marker_height = 0.5
floor = [[0.0, 0.0], [4.0, 0.0], [4.0, 6.0], [0.0, 6.0]]

[[vision.plan.cameras]]
name = "1"
position = [-1.0, 1.5]      # foot of the pole
height = 2.3
pan_deg = 0.0               # looks along x
depth = [1.0, 4.5]          # sees the floor from 1 m to 4.5 m
"""
"""A plan of one camera, to change."""


def example_tables(names: Collection[str]) -> str:
    """Tables of campaign.toml that state some hardware, as an example to change."""
    chosen = {name: keys for name, keys in EXAMPLES.items() if name in names}
    return "\n".join(
        f"[{name}]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items())
        for name, keys in chosen.items()
    )
