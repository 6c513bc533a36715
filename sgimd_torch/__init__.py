"""SGIM-D: robot learning by curiosity and demonstration (Nguyen & Oudeyer, Autonomous Robots 36(3), 2014).

Modules for each section of the paper:

    2.1    contexts, policies, outcomes, episodes          spaces, environments.protocol
    3      the learner and the five algorithms             learner, algorithms, session
    3.2    goal interest mapping, deciding a goal          goals, competence (eqs. 1-4)
    4      the fishing rod                                 environments.fishing_rod, environments.rod_physics
    4.1    motor primitives, correspondence                environments.motor_primitives (eqs. 5, 6)
    4.2    imitate a policy                                strategies
    4.3    performance                                     competence (eq. 7)
    4.4    goal-directed policy optimisation               strategies, explore, inverses (eqs. 8, 9), searches
    5.2    evaluation                                      evaluation (eq. 10)
    5.3    demonstrations and teachers                     demonstrations, teachers
    -      practice, our default learner                   algorithms.practice
    -      a forward model, our addition                   forward_model

``parts`` says what each kind of part is given and must do. ``record`` keeps all events in the life of a learner.
``runs`` makes runs on disk; ``board`` shows them in TensorBoard. All of this is the core; around it stand rooms, see
``rooms`` and ``docs/explained/house.md``. ``__init__.pyi`` lists the public names of the core, each room its own. A
name is loaded when it is first used.
"""

import importlib
from typing import Any

import lazy_loader

from sgimd_torch.rooms import public_names

__version__ = "0.5.0"
_of_core, _, _names = lazy_loader.attach_stub(__name__, __file__)
__all__ = [*_names, *public_names()]


def __getattr__(name: str) -> Any:
    if name in public_names():
        return getattr(importlib.import_module(f"{__name__}.{public_names()[name]}"), name)
    return _of_core(name)


def __dir__() -> list[str]:
    return __all__
