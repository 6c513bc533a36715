"""The forward model (not in the paper): networks that predict where a movement lands.

A `ForwardModel` predicts; all parts of a learner share one, see `shared`. `ProvedModel` and `ModelAlone` answer by it,
`GradientSearch` searches through it. All of it needs torch.
"""

try:
    import lightning  # noqa: F401
    import safetensors  # noqa: F401
    import torch  # noqa: F401
except ImportError as error:
    raise ImportError(f"the forward model needs torch: pip install 'sgimd-torch[forward]' ({error})") from error
