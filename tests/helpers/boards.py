"""Helpers for tests of boards: they read the event file of a run with TensorBoard's own reader."""

from pathlib import Path

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.plugins.hparams.metadata import (
    EXPERIMENT_TAG,
    SESSION_START_INFO_TAG,
    parse_experiment_plugin_data,
    parse_session_start_info_plugin_data,
)

from marks import slow
from own import MODULE
from sgimd_torch.runs.command import main
from sgimd_torch.runs.program import command

# Robots with outcomes of one, three and two dimensions; the names of the last one look like formulas.
ANY_OUTCOMES = [slow("sliders:Slider"), "sliders:Slider3", slow("sliders:Shifted"), "formula:Slider2"]


def board_of(directory):
    """The content of the only event file of a run."""
    (path,) = directory.glob("events.out.tfevents.*")
    return EventAccumulator(str(path), size_guidance={"scalars": 0, "images": 0, "tensors": 0}).Reload()


def curves_of(directory):
    """The values {step: value} of each tag; fails if a tag has a step twice."""
    board, curves = board_of(directory), {}
    for tag in board.Tags()["scalars"]:
        points = board.Scalars(tag)
        curves[tag] = {point.step: point.value for point in points}
        assert len(curves[tag]) == len(points), tag
    return curves


def pictures_of(directory):
    """The pictures {step: png} of each tag."""
    board = board_of(directory)
    return {
        tag: {image.step: image.encoded_image_string for image in board.Images(tag)} for tag in board.Tags()["images"]
    }


def hparams_of(directory):
    board = board_of(directory)
    start = parse_session_start_info_plugin_data(board.SummaryMetadata(SESSION_START_INFO_TAG).plugin_data.content)
    values = {name: value.string_value or value.number_value for name, value in start.hparams.items()}
    about = parse_experiment_plugin_data(board.SummaryMetadata(EXPERIMENT_TAG).plugin_data.content)
    assert {info.name for info in about.hparam_infos} == values.keys()
    return values, [info.name.tag for info in about.metric_infos]


def board_of_any(robot, module):
    """The directory of a run with a board, on one of the robots ``ANY_OUTCOMES``."""
    named = "self.outcomes = Box(-np.ones(2), 3 * np.ones(2), ('$\\\\frac{$', '$x_$'), '$\\\\frac{$')"
    module("formula", MODULE.replace("        self.rest", f"        {named}\n        self.rest", 1))
    words = f"--environment {robot} --algorithm sagg-riac --movements 60 --evaluate-at 30 --repeats 0 --out runs"
    assert command(main, [*words.split(), "--board", "true"]) == 0
    return Path("runs/sagg-riac/seed-000")
