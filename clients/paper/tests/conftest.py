"""The real server, if CHEFSHAT_BIN names its binary, and the settings of JAX."""

from shared import anywhere, no_secrets, processes, pytest_collection_modifyitems, pytest_configure, real_address, real_binary  # noqa: F401 - pytest finds them here.
