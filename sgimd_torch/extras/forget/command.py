"""Take back movements of a run whose outcomes were wrong: the learner is as if it had never learnt from them.

Movements are counted from 0, as in messages ("movement 12 failed") and in the column movement of run.sqlite. There they
stay, and so does the fact that they were taken back. The learner begins again with all its other movements: memory and
answers change at once, its goal model begins anew. Errors that were measured earlier stay what they were.

Exit code: 0 done, 2 the request is wrong and nothing has changed.

Example: somebody leant on the table in movement 12, and the camera was covered from movement 40 to 45.
  sgimd forget runs/practice/seed-000 --movements 12,40-45
  sgimd run --environment lab:Arm --algorithm practice --movements 300 --resume      go on without them
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from functools import partial
from itertools import chain
from pathlib import Path

from sgimd_torch.record import Record
from sgimd_torch.runs.directory import RUN_FILE
from sgimd_torch.runs.load import OpenRun
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.program import argument, parser_of
from sgimd_torch.texts import SPANS


def main(argv: Sequence[str] | None = None) -> int:
    """Take back the movements and return the exit code 0.

    Raises:
        ValueError: there is no such run, another process writes it, or a movement cannot be taken back.
        OSError: the record cannot be written.
    """
    options = parser().parse_args(argv)
    with Record(options.run / RUN_FILE, write=True) as record:
        run = OpenRun(options.run, trust=options.trust)
        run.recall()
        learner, end = run.parts.learner, record.movements
        spans = (range(span.start, min(span.stop, max(span.start, end) + 1)) for span in options.movements)
        learner.listeners.append(record.add)
        learner.forget(chain(*spans))
        while not record.commit():
            say(f"another program reads {record.path}; waiting for its end")
            time.sleep(1)
    say(*map(str, learner.changes))
    print(f"{options.run}: {len(learner.memory)} exemplars are left")
    return 0


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd forget``."""
    parser = parser_of("forget", __doc__)
    parser.add_argument("run", type=Path, help="directory of a run: OUT/NAME/seed-003")
    spans = partial(argument, SPANS)
    parser.add_argument("--movements", type=spans, required=True, metavar="N,N-N", help="numbers, from 0: 12,40-45")
    parser.add_argument("--trust", action="store_true", help="execute the user's code that the settings of RUN name")
    return parser
