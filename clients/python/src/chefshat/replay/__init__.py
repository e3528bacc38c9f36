"""Learning from games that were played before: transitions of records and datasets, and a buffer to draw them from.

`buffer` keeps transitions, however they came about; `recorded` makes them of records and datasets; `tables` reads the files of
datasets. What a dataset's columns hold is told in docs/datasets.md.
"""

from chefshat.replay.buffer import ReplayBuffer
from chefshat.replay.recorded import from_dataset, from_records, from_server, save_record

__all__ = ["ReplayBuffer", "from_dataset", "from_records", "from_server", "save_record"]
