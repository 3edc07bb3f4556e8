"""What the names of points say."""


def robot_point(name: str) -> tuple[str, str] | None:
    """Pose and rig point of a name such as '7/O'; None for any other point."""
    pose, slash, point = name.partition("/")
    return (pose, point) if slash else None
