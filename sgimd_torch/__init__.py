"""SGIM-D: robot learning by curiosity and demonstration (Nguyen & Oudeyer, Autonomous Robots 36(3), 2014).

Where each part of the paper lives:

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
    -      practice, our default learner                   algorithms.practice, goals.within_reach, explore
    -      asking teachers: SGIM-IM, SGIM-ACTS             asking
    -      our addition: a forward model                   forward_model
    -      robots of gymnasium, and ours as its            environments.from_gymnasium, environments.to_gymnasium
    -      rivals of other schools                         rivals

What each kind of part is given and must do stands in ``parts``. A life is kept by ``record``. ``runs`` makes runs on
disk, ``views`` shows them, with ``board`` (TensorBoard) and ``figures``; their command is ``sgimd``. Names that this
package offers are listed in ``__init__.pyi`` and loaded when they are used.
"""

import lazy_loader

__version__ = "0.2.0"
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
