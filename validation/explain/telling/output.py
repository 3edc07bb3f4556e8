"""Files and JSON of an explanation."""

from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import version

import numpy as np

from validation.explain.analysis import Explanation, SystemExplanation
from validation.explain.sources.verdicts import CELLS
from validation.explain.telling.words import findings
from validation.poses.pose_table import to_csv
from validation.text_files.json_text import json_text

FOLDER = "explain"
"""Under results/: none of it is read back as a system's poses."""


def explanation_files(explanation: Explanation) -> dict[str, str | bytes]:
    """Corrected poses, flags and all numbers, by names relative to results/."""
    files: dict[str, str | bytes] = {
        f"{FOLDER}/explanation.json": json_text(explanation_json(explanation)),
        f"{FOLDER}/flagged.csv": flagged_csv(explanation),
    }
    for one in explanation.systems:
        if one.settled is not None:
            files[f"{FOLDER}/corrected_{one.system}.csv"] = corrected_csv(one)
    return files


def corrected_csv(one: SystemExplanation) -> str:
    """All poses of a system with the systematic part taken out, and where they came from.

    Poses without a validation pose are corrected too. Covariances hold the GT's own and what the
    fitted parameters do not know; where the GT states none they stay blank.
    """
    settled = one.settled
    assert settled is not None
    table, pairs = one.table, settled.pairs
    place = {name: row for row, name in enumerate(pairs.ids)}
    if pairs.motion is not None or settled.fit.model.drifts:
        table = table.select([name for name in table.ids if name in place])
        order = [place[name] for name in table.ids]
        poses = settled.corrected_poses(pairs.convention.read(table.poses), order)
    else:
        poses = settled.corrected_poses(pairs.convention.read(table.poses))
    covariances = np.full((len(table), 3, 3), np.nan)
    if pairs.stated:
        known = settled.corrected_covariances()
        for row, name in enumerate(table.ids):
            if name in place:
                covariances[row] = known[place[name]]
    note = f"corrected: {one.name} ({_values(one)})"
    sources = tuple(f"{source + ' - ' if source else ''}{note}" for source in table.sources)
    done = replace(
        table, poses=poses, covariances=covariances, sources=sources, joint=None, factor=None
    )
    return to_csv(done)


def _values(one: SystemExplanation) -> str:
    """Fitted parameters in one cell."""
    settled = one.settled
    assert settled is not None
    named = zip(settled.fit.model.fitted, settled.fit.parameters[0], strict=True)
    return " ".join(f"{name}={value:.6g}" for name, value in named) or "unchanged"


def flagged_csv(explanation: Explanation) -> str:
    """One row a flagged cell."""
    lines = ["pose,cell,source,certainty,off_by,p_value"]
    for one in explanation.arbitration.verdicts:
        who = "+".join(one.blamed)
        lines.append(
            f"{one.stop},{one.cell},{who},{one.certainty},{one.size:.6g},{one.p_value:.3g}"
        )
    return "\n".join(lines) + "\n"


def explanation_json(explanation: Explanation) -> Mapping[str, object]:
    """All numbers, for scripts."""
    question, result = explanation.question, explanation.arbitration
    intervals = result.variances.intervals(question.confidence)
    return {
        "gtval": version("gtval"),
        "confidence": question.confidence,
        "invented": question.invented,
        "false_alarm": question.false_alarm,
        "systems": {one.system: _system(one, question.confidence) for one in explanation.systems},
        "sensors": {
            one.sensor: {
                "systems": one.systems,
                "mounts": one.mounts,
                "joint": one.joint,
                "joint_covariance": one.joint_covariance,
                "differences": one.differences(question.confidence),
                "p_value": one.p_value,
                "same": one.p_value >= 1 - question.confidence,
            }
            for one in explanation.agreements
        },
        "flagged": result.verdicts,
        "suspects": result.suspects,
        "questions": result.questions,
        "false_alarm_by_tails": result.rate,
        "heavy_tails": None if result.tails is None else result.tails.heavy,
        "copies": [
            {"systems": one.names, "apart": one.apart, "others": one.others}
            for one in result.copies
        ],
        "noise": {
            name: {
                cell: {
                    "variance": result.variances.variances[row, kind],
                    "std_low": intervals[row, kind, 0],
                    "std_high": intervals[row, kind, 1],
                    "used": result.noise[row, kind],
                }
                for kind, cell in enumerate(CELLS)
            }
            for row, name in enumerate(result.sources)
        },
        "findings": findings(explanation),
    }


def _system(one: SystemExplanation, confidence: float) -> Mapping[str, object]:
    """Numbers of one system."""
    if one.selection is None or one.settled is None:
        return {"explanation": one.name, "poses": len(one.table)}
    selection, settled = one.selection, one.settled
    weights = selection.weights
    evidence = one.reference
    return {
        "explanation": one.name,
        "words": settled.fit.model.words,
        "convention": selection.pairs.convention.name or None,
        "neighbours_depend": selection.dependent,
        "neighbours_log_odds": selection.memory if np.isfinite(selection.memory) else None,
        "intervals_withheld": settled.serial.withheld if settled.serial is not None else "",
        "poses": len(selection.pairs),
        "left_out_as_constructed": selection.pairs.constructed,
        "reference": selection.pairs.reference or None,
        "noise_stated": selection.pairs.stated,
        "noise_estimated": selection.pairs.estimated,
        "parameters": settled.parameters(confidence),
        "covariance": settled.covariance,
        "threshold": selection.threshold,
        "candidates": [
            {
                "name": item.name,
                "parameters": dict(
                    zip(item.model.fitted, item.fit.parameters[0].tolist(), strict=True)
                ),
                "bic": item.criterion,
                "bic_weight": weights[item.name],
                "log_likelihood": item.fit.log_likelihood[0],
                "loo_log_score": item.loo.score,
                "loo_median_position": item.loo.typical_length,
                "loo_median_heading": item.loo.typical_angle,
                "p_values": item.p_values,
                "not_determined": item.observability.undetermined,
                "needed": item.needed,
            }
            for item in selection.candidates
        ],
        "not_ruled_out": [item.name for item in selection.rivals],
        "inferred_reference": None
        if evidence is None
        else {
            "possible": evidence.possible,
            "p_values": dict(zip(evidence.ids, evidence.p_values.tolist(), strict=True)),
            "odds": evidence.odds,
            "heading": evidence.heading,
            "heading_sigma": evidence.heading_sigma,
            "accepted": evidence.accepted,
        },
        "statistics": {
            which: {
                "mean": settled.mean(errors, everything=everything),
                "std": settled.spread(errors, everything=everything),
            }
            for which, errors, everything in (
                ("before_all", settled.before, True),
                ("after_all", settled.after, True),
                ("before", settled.before, False),
                ("after", settled.after, False),
            )
        },
        "rms_after_freedom_counted": settled.noise,
        "explained": settled.explained,
        "cells_used": settled.cells.sum(0),
        "degrees_of_freedom": settled.dof,
    }
