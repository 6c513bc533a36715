"""Explauto as its tutorials use it, in a process of its own libraries: a line of JSON is asked, a line is answered.

Goals by progress (its interest model `tree`), and movements by `nearest_neighbor` with noise. `LWLR-BFGS` answers, the
most exact of its inverse models. Both boxes are unit cubes. Of three interest models and two numbers of random
movements at first these err least on seeds 1000 and 1001.
"""

import collections
import collections.abc
import json
import sys

import numpy as np

for name in ("Callable", "Iterable", "Mapping", "MutableMapping", "Sequence"):  # gone from there since Python 3.10
    setattr(collections, name, getattr(collections.abc, name))

from explauto import InterestModel, SensorimotorModel  # type: ignore[import-not-found]  # noqa: E402
from explauto.utils.config import make_configuration  # type: ignore[import-not-found]  # noqa: E402

FIRST = 50  # random movements at first

theta_dim, outcome_dim, seed = json.loads(sys.stdin.readline())
np.random.seed(seed)  # noqa: NPY002
boxes = make_configuration([0.0] * theta_dim, [1.0] * theta_dim, [0.0] * outcome_dim, [1.0] * outcome_dim)
model = SensorimotorModel.from_configuration(boxes, "nearest_neighbor", "default")
interest = InterestModel.from_configuration(boxes, boxes.s_dims, "tree", "default")
answering = SensorimotorModel.from_configuration(boxes, "LWLR-BFGS", "default")
answering.mode = "exploit"
made, goal = 0, None
print("null", flush=True)
for line in sys.stdin:
    (word, *given), reply = json.loads(line), None
    if word == "move":
        goal = None if made < FIRST else interest.sample()
        theta = np.random.rand(theta_dim) if goal is None else model.inverse_prediction(goal)  # noqa: NPY002
        reply = np.clip(theta, 0, 1).tolist()
    elif word == "tell":
        theta, outcome = map(np.array, given)
        if goal is not None:
            interest.update(np.hstack((theta, goal)), np.hstack((theta, outcome)))
        model.update(theta, outcome)
        answering.update(theta, outcome)
        made += 1
    else:
        reply = [np.clip(answering.inverse_prediction(np.array(wanted)), 0, 1).tolist() for wanted in given[0]]
    print(json.dumps(reply), flush=True)
