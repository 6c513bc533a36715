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
    -      asking teachers: SGIM-IM, SGIM-ACTS             asking
    -      a forward model, our addition                   forward_model
    -      robots of gymnasium; our robots in gymnasium    environments.from_gymnasium, environments.to_gymnasium
    -      other algorithms to compare with                rivals

``parts`` says what each kind of part is given and must do. ``record`` keeps all events in the life of a learner.
``runs`` makes runs on disk; ``views``, ``board`` (TensorBoard) and ``figures`` show them. The command ``sgimd`` calls
these folders. ``__init__.pyi`` lists the public names of this package. A name is loaded when it is first used.
"""

import lazy_loader

__version__ = "0.4.0"
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
