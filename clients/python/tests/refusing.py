"""Refusals of fake services, with the error details of the protocol."""

from collections.abc import Callable
from typing import Any, NoReturn, TypeAlias

import grpc
from google.protobuf import any_pb2
from google.rpc import error_details_pb2, status_pb2

Context = grpc.ServicerContext
Handler: TypeAlias = "grpc.RpcMethodHandler[Any, Any] | None"


def refuse(context: Context, code: grpc.StatusCode, reason: str, message: str, **metadata: str) -> NoReturn:
    """Ends a call with google.rpc.ErrorInfo."""
    detail = any_pb2.Any()
    detail.Pack(error_details_pb2.ErrorInfo(reason=reason, domain="chefshat", metadata=metadata))
    status = status_pb2.Status(code=code.value[0], message=message, details=[detail])
    context.set_trailing_metadata((("grpc-status-details-bin", status.SerializeToString()),))
    context.abort(code, message)
    raise AssertionError("abort always raises")


class Guard(grpc.ServerInterceptor):
    """Refuses calls without a token, and counts the calls."""

    def __init__(self, token: str) -> None:
        self._token = token
        self.calls = 0

    def intercept_service(
        self,
        continuation: Callable[[grpc.HandlerCallDetails], Handler],
        details: grpc.HandlerCallDetails,
    ) -> Handler:
        """Passes on a call with the token; otherwise says whether it is missing or unknown."""
        self.calls += 1
        given = dict(details.invocation_metadata).get("authorization")
        handler = continuation(details)
        if given == f"Bearer {self._token}" or handler is None:
            return handler
        reason = "TOKEN_UNKNOWN" if given else "TOKEN_MISSING"

        def refused(_request: object, context: Context) -> NoReturn:
            refuse(context, grpc.StatusCode.UNAUTHENTICATED, reason, "this server requires a token")

        make = {
            (False, False): grpc.unary_unary_rpc_method_handler,
            (False, True): grpc.unary_stream_rpc_method_handler,
            (True, False): grpc.stream_unary_rpc_method_handler,
            (True, True): grpc.stream_stream_rpc_method_handler,
        }[handler.request_streaming, handler.response_streaming]
        return make(refused, handler.request_deserializer, handler.response_serializer)
