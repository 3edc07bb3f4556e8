"""Numbers of the vision system for scripts."""

import numpy as np

from vision_gt.campaign.detections import detection_facts
from vision_gt.campaign.outcome import VisionOutcome
from vision_gt.campaign.printed import seen_in


def vision_facts(outcome: VisionOutcome) -> dict[str, object]:
    """What --json prints and results/run.json keeps."""
    network = outcome.network.network
    return {
        "stops": len(outcome.stops),
        "stops_with_pose": [stop.pose for stop in outcome.stops if stop.chosen is not None],
        "stops_ambiguous": [
            stop.pose
            for stop in outcome.stops
            if stop.chosen is None and any(p.ambiguous for p in stop.by_camera.values())
        ],
        "cameras": {
            camera.name: {
                "position": [float(v) for v in network.T_gtv_camera[i].translation],
                "position_sigma": [
                    float(network.pose_covariance(camera.name)[k, k] ** 0.5) for k in range(3)
                ],
                "chain": list(outcome.network.chain.path(camera.name)),
            }
            for i, camera in enumerate(network.cameras)
        },
        "corner_sigma": network.sigma,
        "marker_corner_sigma": _marker_corner_sigma(outcome),
        "calibration_rms": {name: c.rms for name, c in outcome.calibrations.items()},
        "steadiness": {one.camera: one.verdict for one in outcome.steadiness},
        "checks": {
            "table": outcome.checks.table,
            "survey": outcome.checks.survey,
            "displacement": outcome.checks.displacement,
        },
        "as_published": bool(outcome.published),
        "detection": detection_facts(seen_in(outcome), outcome.printed),
    }


def _marker_corner_sigma(outcome: VisionOutcome) -> float | None:
    """Median standard deviation of a coordinate of the robot's markers' corners, pixels."""
    views = [view for found in outcome.detections.values() for view in found.views]
    if not views:
        return None
    traces = np.trace([view.covariances for view in views], axis1=2, axis2=3)
    return float(np.median(np.sqrt(traces / 2)))
