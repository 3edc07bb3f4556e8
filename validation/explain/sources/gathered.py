"""All sources at all stops, systematic parts taken out, as they are held against each other."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from validation.explain.fitting.pairs import Pairs
from validation.explain.fitting.settled import Settled, by_level
from validation.explain.sources.copies import Copies
from validation.explain.sources.verdicts import Sources
from validation.poses.pose_table import PoseTable


def gathered(
    validation: PoseTable,
    systems: Sequence[PoseTable],
    pairs: Sequence[Pairs],
    fits: Sequence[Settled | None],
    settled: Sequence[Settled | None],
    sensors: Mapping[str, Sequence[str]],
    witnesses: Sequence[PoseTable],
) -> Sources:
    """All sources at all stops of the validation, systematic parts taken out."""
    ids = validation.ids
    row = {name: number for number, name in enumerate(ids)}
    tables = [validation, *systems, *witnesses]
    poses = np.full((len(tables), len(ids), 3), np.nan)
    covariances = np.full((len(tables), len(ids), 3, 3), np.nan)
    lost = np.zeros((len(tables), 2))
    poses[0], covariances[0] = validation.poses, validation.covariances
    levels = [one.fit.scale[0] for one in fits if one is not None and one.pairs.contradicted]
    if len(levels) == len(systems):  # nobody knows whose covariances are wrong
        covariances[0] *= by_level(np.median(levels, axis=0))
    for number, (one, fit, done) in enumerate(zip(pairs, fits, settled, strict=True), 1):
        rows = [row[name] for name in one.ids]
        poses[number, rows] = one.gt if fit is None else fit.corrected_poses(one.gt)
        if one.stated:
            covariances[number, rows] = (
                one.gt_covariances if fit is None else fit.corrected_covariances()
            )
        lost[number] = 0 if done is None else done.used_freedom
    for number, table in enumerate(witnesses, len(pairs) + 1):
        rows = [row[name] for name in table.ids if name in row]
        known = table.select([name for name in table.ids if name in row])
        poses[number, rows], covariances[number, rows] = known.poses, known.covariances
    return Sources(
        tuple(table.system for table in tables),
        ids,
        poses,
        covariances,
        {sensor: tuple(names) for sensor, names in sensors.items()},
        lost,
        contradicted=bool(levels),
    )


def as_one(sources: Sources, copies: Sequence[Copies]) -> Sources:
    """The sources, copies of one another counted as of one sensor."""
    if not copies:
        return sources
    sensors = dict(sources.sensors)
    for group in copies:
        names = set(group.names)
        for sensor in [one for one, inside in sensors.items() if set(inside) & names]:
            names |= set(sensors.pop(sensor))
        sensors[" = ".join(group.names)] = tuple(n for n in sources.names if n in names)
    return replace(sources, sensors=sensors)
