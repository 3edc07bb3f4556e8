"""What a lab tells of its ground truth in one sentence."""

import gtval


def verdict(survey: gtval.PoseTable, rig: gtval.PoseTable) -> str:
    """Whether a bias of the rig may be larger than the lab accepts: 5 cm, 0.05 rad."""
    for finding in gtval.findings(gtval.compare(survey, rig, acceptable_bias=(0.05, 0.05))):
        if finding.code == "bias" and finding.severity == "warning":
            return f"Do not use {rig.system}: {finding.text}"
    return f"{rig.system} can be used."
