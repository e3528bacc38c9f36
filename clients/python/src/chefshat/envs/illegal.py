"""Illegal actions in environments: how many are allowed at one decision, and what they cost.

An agent that does not know the mask is therefore not trapped at a decision for which it knows no legal action.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chefshat.columns import Situations
from chefshat.envs.options import EnvOptions
from chefshat.masks import is_legal

#: Default number of illegal actions at one decision after which the default action is taken.
MAX_INVALID_ATTEMPTS = 10


def with_limit(invalid: str, options: EnvOptions) -> dict[str, Any]:
    """Returns the options of a `VectorEnv` with `invalid`, and with the limit unless they have another; 0 is none."""
    limit = {"max_invalid_attempts": MAX_INVALID_ATTEMPTS} if invalid == "ask_again" else {}
    return {"invalid": invalid, **limit, **options}


def penalties(situations: Situations, actions: NDArray[Any], penalty: float) -> NDArray[np.float64]:
    """Returns what each row's action costs: the penalty if it is illegal, else 0."""
    in_range = actions.shape == (len(situations),) and ((actions >= 0) & (actions < situations.sizes.num_actions)).all()
    if penalty == 0 or not in_range:
        # The step refuses what is out of range.
        return np.zeros(len(situations))
    return np.where(is_legal(situations.mask_bits, actions), 0.0, penalty)
