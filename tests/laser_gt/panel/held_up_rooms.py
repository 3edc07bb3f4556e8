"""A room whose matches are right and held up, by limits of the verdicts that are too strict."""

import shutil

from laser_rooms import write_campaign

STRICT = """
[laser.judgement]
agreement = [0.9999, 0.3]
return_share = 0.0
"""
"""No match in a room with noise agrees in more than 99.99 % of the points: one objection each. The
loops of three stops are too few for the matches to confirm each other."""


AMBIGUOUS = """
[laser.judgement]
rival_margin = 1e9
"""
"""Any other pose agrees about as well: many stops do not confirm each other either."""


def held_up_room(folder, stops=3, seed=1, strict=STRICT):
    write_campaign(folder, seed=seed, stops=stops)
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text() + strict)
    return folder


def copied(folder, to):
    shutil.copytree(folder, to)
    return to
