"""The forward model (not in the paper): networks that predict the outcome of a movement.

All parts of a learner share one `ForwardModel`, see `shared`. The inverse models `ProvedModel` and `ModelAlone` and the
search `GradientSearch` use this model. This folder needs torch.
"""

try:
    import lightning  # noqa: F401
    import torch  # noqa: F401
except ImportError as error:
    raise ImportError(f"the forward model needs torch: pip install 'sgimd-torch[forward]' ({error})") from error
