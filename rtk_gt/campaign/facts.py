"""Numbers of a drive for scripts."""

from rtk_gt.campaign.outcome import RtkOutcome
from rtk_gt.offsets.estimate import distance_names
from rtk_gt.path.vehicle_path import heading_span, tilt_spread


def rtk_facts(outcome: RtkOutcome) -> dict[str, object]:
    """What `--json` and run.json hold of a drive."""
    offsets, found = outcome.offsets, outcome.coverage
    return {
        "frame": str(outcome.steps.frame),
        "poses": len(outcome.path),
        "share_of_time": found.share_of_time,
        "share_of_length": found.share_of_length,
        "longest_gap": found.gaps[0].duration if found.gaps else 0.0,
        "offsets": dict(zip(offsets.receivers, offsets.offsets.values, strict=True)),
        "offset_sigmas": dict(zip(offsets.receivers, offsets.offset_sigmas, strict=True)),
        "undetermined_directions": int((offsets.signal <= 0).sum()),
        "distances": dict(zip(distance_names(offsets.receivers), offsets.distances, strict=True)),
        "antennas": dict(zip(offsets.receivers, outcome.antennas.positions, strict=True)),
        "sigma_horizontal": outcome.noise.sigma,
        "sigma_vertical": outcome.noise.sigma * outcome.noise.eta,
        "errors_that_last": outcome.model,
        "common_errors": {
            "source": outcome.common.source,
            "sigma": outcome.common.sigma,
            "stated": outcome.common.stated,
        },
        "jumps": [
            {
                "receivers": [offsets.receivers[k] for k in one.receivers],
                "start": one.start,
                "end": None if one.stays else one.end,
                "size": one.size,
                "covariance": one.covariance,
            }
            for one in outcome.lasting
        ],
        "heading_span": heading_span(outcome.path),
        "tilt_spread": tilt_spread(outcome.path),
        "motion": outcome.motion,
        "false_fixes": int((offsets.weights == 0).sum()),
        "leaping_poses": outcome.path.times[outcome.leaps],
        "consistency": {
            "bound": outcome.consistency.bound,
            "share_beyond": outcome.consistency.share_beyond,
            "mean_square": outcome.consistency.mean_square,
            "mean_square_interval": outcome.consistency.mean_square_interval,
            "correlation_time": outcome.consistency.correlation_time,
        },
        "areas": outcome.areas,
        "reference_covariance": outcome.reference,
        "interpolation": None if outcome.hold_out is None else outcome.hold_out.chosen,
    }
