"""Field entry: how many typing errors are noticed at once, how many in the end, how falsely.

Simulated campaigns of 16 world points and two stops are entered by a person who goes wrong at one
number in a hundred and looks again where something is doubtful. One in six errors each: two
digits exchanged, one left out, one doubled, the point misplaced (which is what mixing up metres
and millimetres does, apart from what magnitude tells), the laser on another world point, the
number before typed once more. 'In the end': corrected in the room, or named by the adjustment.
Arguments: how many campaigns (1000), the first seed (10000), processes (2).
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "survey" / "entry"))

from entry_simulation import Tally, simulate_entry, table

ASKED_AT_ONCE, ASKED_FALSE = 0.95, 0.01
PRINTED = 50
"""The table so far is printed after so many campaigns."""


def main() -> None:
    given = [int(text) for text in sys.argv[1:]]
    campaigns, first, processes = (*given, *(1000, 10_000, 2)[len(given) :])
    tally = Tally()
    with ProcessPoolExecutor(processes) as pool:
        seeds = range(first, first + campaigns)
        for number, one in enumerate(pool.map(simulate_entry, seeds, chunksize=5), 1):
            tally.add(one)
            if number % PRINTED == 0 or number == campaigns:
                print(f"\n{number:,} campaigns, seeds from {first}")
                print("\n".join(table(tally)), flush=True)
    late = tally.large(of_stop=True, earlier=3)
    noticed = sum(slip.at_once for slip in late) / len(late)
    false = tally.false_alarms / tally.readings
    print(
        f"noticed at once after a stop's third reading: {noticed:.2%} (asked {ASKED_AT_ONCE:.0%})"
    )
    print(f"false alarms: {false:.3%} (asked less than {ASKED_FALSE:.0%})")


if __name__ == "__main__":
    main()
