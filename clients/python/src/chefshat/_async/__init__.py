"""The source of the calls that both clients offer. `tools/generate.py` derives the blocking form in `_sync` from it."""
