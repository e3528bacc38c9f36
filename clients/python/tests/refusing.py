"""Refusals of fake services, with the error details of the protocol."""

from typing import NoReturn

import grpc
from google.protobuf import any_pb2
from google.rpc import error_details_pb2, status_pb2

Context = grpc.ServicerContext


def refuse(context: Context, code: grpc.StatusCode, reason: str, message: str, **metadata: str) -> NoReturn:
    """Ends a call with google.rpc.ErrorInfo."""
    detail = any_pb2.Any()
    detail.Pack(error_details_pb2.ErrorInfo(reason=reason, domain="chefshat", metadata=metadata))
    status = status_pb2.Status(code=code.value[0], message=message, details=[detail])
    context.set_trailing_metadata((("grpc-status-details-bin", status.SerializeToString()),))
    context.abort(code, message)
    raise AssertionError("abort always raises")
