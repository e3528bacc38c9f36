"""Coroutines as tests, and the real server, if the environment variable CHEFSHAT_BIN names its binary."""

from shared import no_secrets, pytest_collection_modifyitems, pytest_pyfunc_call, real_binary  # noqa: F401 - pytest finds them here.
from shared import real_address as server_address  # noqa: F401
