"""What the tests of boards share: the event file of a run, as TensorBoard's own reader has it."""

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator


def board_of(directory):
    """What the only event file of a run holds."""
    (path,) = directory.glob("events.out.tfevents.*")
    return EventAccumulator(str(path), size_guidance={"scalars": 0, "images": 0, "tensors": 0}).Reload()


def curves_of(directory):
    """By tag: {step: value}; a step that is there twice fails."""
    board, found = board_of(directory), {}
    for tag in board.Tags()["scalars"]:
        points = board.Scalars(tag)
        found[tag] = {point.step: point.value for point in points}
        assert len(found[tag]) == len(points), tag
    return found


def pictures_of(directory):
    """By tag: {step: png}."""
    board = board_of(directory)
    return {
        tag: {image.step: image.encoded_image_string for image in board.Images(tag)} for tag in board.Tags()["images"]
    }
