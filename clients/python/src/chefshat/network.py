"""gRPC, for modules that talk to a server. Environments in this process never import this module, so they work without gRPC."""

try:
    import grpc as grpc
    import grpc.aio  # noqa: F401 - Makes `grpc.aio` available.
except ImportError as error:
    message = "a server is reached over gRPC, which is not installed: pip install grpcio googleapis-common-protos"
    raise ImportError(message) from error
