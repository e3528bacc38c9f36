"""Learning from recorded games: transitions from records and datasets, and a replay buffer.

`buffer` stores transitions; `recorded` creates them from records and datasets; `tables` reads the files of datasets. The columns of
datasets are described in docs/datasets.md.
"""

from chefshat.replay.buffer import ReplayBuffer
from chefshat.replay.recorded import from_dataset, from_records, from_server, save_record

__all__ = ["ReplayBuffer", "from_dataset", "from_records", "from_server", "save_record"]
