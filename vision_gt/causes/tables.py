"""What was tried against what did not fit, and how noisy corners are, as tables."""

from collections.abc import Callable

import numpy as np

from validation.results import Table
from vision_gt.causes.diagnosis import Diagnosis
from vision_gt.causes.telling import said_of
from vision_gt.causes.trial import Noise


def hypothesis_table(diagnosis: Diagnosis) -> Table:
    """Hypotheses that were solved in full, the best first, with what speaks for them."""
    tried = diagnosis.ranking.tried
    nothing = diagnosis.nothing.criterion
    said = ["nothing is wrong" if one is diagnosis.nothing else said_of(one.what) for one in tried]
    return Table.of_columns(
        "What was tried",
        [
            ("chi-squared", ".0f", [one.chi_squared for one in tried]),
            ("degrees of freedom", "", [one.freedom for one in tried]),
            ("better than nothing by", ".1f", [nothing - one.criterion for one in tried]),
            ("hypothesis", "", said),
        ],
        "Better: twice the logarithm of the odds against 'nothing is wrong', with what its numbers "
        "and the places where it was sought cost, and what surveyed stops say of it. 14 are a "
        "thousand to one, and are told.",
    )


def noise_table(noise: tuple[Noise, ...]) -> Table:
    """How much corners scatter, over what the detector states, by camera."""
    names = list(dict.fromkeys(one.camera for one in noise))
    found = {(one.kind, one.camera): one for one in noise}

    def of(kind: str, value: Callable[[Noise], float]) -> list[float | None]:
        own = [found.get((kind, name)) for name in names]
        return [None if one is None else value(one) for one in own]

    over, pixels = (lambda one: one.factor), (lambda one: one.scatter)

    corners = [int(np.sum([o.corners for o in noise if o.camera == name])) for name in names]
    return Table.of_columns(
        "Noise of the corners, over what is stated",
        [
            ("camera", "", names),
            ("corners", "", corners),
            ("of boards", ".2f", of("boards", over)),
            ("of markers", ".2f", of("markers", over)),
            ("boards, px", ".3f", of("boards", pixels)),
            ("markers, px", ".3f", of("markers", pixels)),
        ],
        "Every board and every marker is fitted by itself, so that nothing but noise and the lens "
        "shows. It should be near 1 or below; from 1.5 on it is a finding. In pixels it should be "
        "alike for cameras of one kind; 1.5 times that of the others is a finding.",
    )
