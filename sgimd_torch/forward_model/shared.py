"""One forward model for all parts of a learner: the inverse model, the search and the listener of a run.

model = model_of(problem, members=5); model_of(problem) is model
"""

from __future__ import annotations

from functools import partial
from typing import Any

from sgimd_torch.forward_model.listener import ModelListener
from sgimd_torch.forward_model.model import ForwardModel, Refresh
from sgimd_torch.memory import Memory
from sgimd_torch.options.signature import with_keywords_of
from sgimd_torch.parts import Inverse, Problem, Trained
from sgimd_torch.runs.run import RunLoop


class SharedModel(Trained):
    """Forward model of a problem.

    Args:
        problem: problem to learn, with the dimensions and the seed of the model.
        options: options of `ForwardModel`.
    """

    def __init__(self, problem: Problem, **options: Any) -> None:
        self.model = ForwardModel(*problem.dims, seed=problem.seed, **options)

    def refresh(self, memory: Memory) -> Refresh | None:
        """Result of `ForwardModel.refresh`."""
        return self.model.refresh(memory)

    def listener(self, life: RunLoop) -> ModelListener:
        """Listener that refreshes the model in a run."""
        learner = life.parts.learner
        asked = partial(is_asked, learner.inverse, self.model)
        return ModelListener(life.record, self.model, asked, learner.memory, life.seconds)


@with_keywords_of(ForwardModel, "members", "rate", "noise_heads", "accelerator", "trust")
def model_of(problem: Problem, **options: Any) -> ForwardModel:
    """The forward model of a problem; the first call makes it, with these options."""
    return problem.shared(SharedModel, partial(SharedModel, problem, **options)).model


class ThroughModel(Inverse):
    """Inverse model that uses the forward model of its problem if the forward model can be trusted.

    Attributes:
        model: forward model.
    """

    says_how_sure = False

    @with_keywords_of(model_of)
    def __init__(self, problem: Problem, **options: Any) -> None:
        super().__init__(problem)
        self.model = model_of(problem, **options)

    @property
    def trusted(self) -> bool:
        """Whether the forward model is used now."""
        return self.model.trusted


def is_asked(inverse: Inverse, model: ForwardModel) -> bool:
    """Whether a learner with this ``inverse`` uses the ``model`` now; a `ThroughModel` has its own ``trusted``."""
    return inverse.trusted if isinstance(inverse, ThroughModel) else model.trusted
