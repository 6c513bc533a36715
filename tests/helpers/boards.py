"""What the tests of boards share: the curves and the charts that an event file holds."""

import numpy as np
from tensorboard.backend.event_processing.event_file_loader import EventFileLoader
from tensorboard.plugins.custom_scalar import layout_pb2
from tensorboard.util.tensor_util import make_ndarray


def values_of(directory):
    (path,) = directory.glob("events.out.tfevents.*")
    return [(event.step, value) for event in EventFileLoader(str(path)).Load() for value in event.summary.value]


def curves_of(directory):
    """By tag: {step: value}; a step that is there twice fails."""
    found = {}
    for step, value in values_of(directory):
        tensor = make_ndarray(value.tensor)
        assert step not in found.setdefault(value.tag, {}), (value.tag, step)
        found[value.tag][step] = tensor.item() if tensor.dtype == np.float32 and tensor.size else tensor.tolist()
    return found


def charts_of(directory):
    """Of the last page of charts: the tags by category."""
    (*_, last) = curves_of(directory)["custom_scalars__config__"].values()
    layout = layout_pb2.Layout.FromString(last)
    return {
        each.title: [tag.strip("^$").replace("\\", "") for chart in each.chart for tag in chart.multiline.tag]
        for each in layout.category
    }
