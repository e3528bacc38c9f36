//! Sends the spans of rooms and decisions to a collector of OpenTelemetry (feature `otlp`).

use opentelemetry::trace::TracerProvider as _;
use opentelemetry_otlp::{SpanExporter, WithExportConfig as _};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::trace::SdkTracerProvider;
use tokio::runtime::Runtime;
use tracing::Subscriber;
use tracing_subscriber::Layer;
use tracing_subscriber::filter::filter_fn;
use tracing_subscriber::registry::LookupSpan;

use crate::error::{CommandError, tell};

/// Sends spans until it is dropped, which sends the last ones.
pub(super) struct Traces {
    provider: SdkTracerProvider,
    /// Runs the connection, also before and after the command runs in a runtime of its own.
    _runtime: Runtime,
}

impl Traces {
    /// Sends to the gRPC endpoint of a collector.
    ///
    /// # Errors
    /// The endpoint is not a URL.
    pub(super) fn to(endpoint: &str) -> Result<Self, CommandError> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()?;
        let entered = runtime.enter();
        let exporter = SpanExporter::builder()
            .with_tonic()
            .with_endpoint(endpoint)
            .build()
            .map_err(|error| format!("--otlp-endpoint {endpoint}: {error}"))?;
        drop(entered);
        let name = Resource::builder().with_service_name("chefshat").build();
        let provider = SdkTracerProvider::builder()
            .with_batch_exporter(exporter)
            .with_resource(name)
            .build();
        Ok(Self {
            provider,
            _runtime: runtime,
        })
    }

    /// The layer that passes on the server's spans, and what is logged in them.
    pub(super) fn layer<S>(&self) -> impl Layer<S> + use<S>
    where
        S: Subscriber + for<'span> LookupSpan<'span>,
    {
        tracing_opentelemetry::layer()
            .with_tracer(self.provider.tracer("chefshat"))
            .with_filter(filter_fn(|of| {
                of.target().starts_with("chefshat_") && *of.level() <= tracing::Level::DEBUG
            }))
    }
}

impl Drop for Traces {
    fn drop(&mut self) {
        if let Err(error) = self.provider.shutdown() {
            tell(format_args!(
                "chefshat: the last spans were not sent: {error}"
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::SocketAddr;

    use opentelemetry_proto::tonic::collector::trace::v1::trace_service_server::{
        TraceService, TraceServiceServer,
    };
    use opentelemetry_proto::tonic::collector::trace::v1::{
        ExportTraceServiceRequest, ExportTraceServiceResponse,
    };
    use opentelemetry_proto::tonic::trace::v1::Span;
    use tokio::net::TcpListener;
    use tokio::sync::mpsc;
    use tokio_stream::wrappers::TcpListenerStream;
    use tonic::{Request, Response, Status};
    use tracing_subscriber::layer::SubscriberExt as _;

    use super::*;

    /// A collector that passes on what it receives.
    struct Collector(mpsc::UnboundedSender<Span>);

    #[tonic::async_trait]
    impl TraceService for Collector {
        async fn export(
            &self,
            request: Request<ExportTraceServiceRequest>,
        ) -> Result<Response<ExportTraceServiceResponse>, Status> {
            let resources = request.into_inner().resource_spans.into_iter();
            let scopes = resources.flat_map(|resource| resource.scope_spans);
            for span in scopes.flat_map(|scope| scope.spans) {
                self.0.send(span).expect("the test waits");
            }
            Ok(Response::new(ExportTraceServiceResponse::default()))
        }
    }

    async fn collector() -> (SocketAddr, mpsc::UnboundedReceiver<Span>) {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("bound");
        let (sender, spans) = mpsc::unbounded_channel();
        let serving = tonic::transport::Server::builder()
            .add_service(TraceServiceServer::new(Collector(sender)))
            .serve_with_incoming(TcpListenerStream::new(listener));
        tokio::spawn(serving);
        (address, spans)
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn the_spans_of_the_server_reach_a_collector_and_no_others() {
        let (address, mut spans) = collector().await;
        let sending = tokio::task::spawn_blocking(move || {
            let traces = Traces::to(&format!("http://{address}")).expect("a URL");
            let subscriber = tracing_subscriber::registry().with(traces.layer());
            tracing::subscriber::with_default(subscriber, || {
                let room =
                    tracing::info_span!(target: "chefshat_hosting::room", "room", room = "r");
                let _room = room.enter();
                tracing::debug_span!(target: "chefshat_hosting::room", "decision").in_scope(|| ());
                tracing::error_span!(target: "hyper", "connection").in_scope(|| ());
            });
        });
        sending.await.expect("no panic");
        let decision = spans.recv().await.expect("a span");
        let room = spans.recv().await.expect("a span");
        assert_eq!(
            (decision.name.as_str(), room.name.as_str()),
            ("decision", "room")
        );
        assert_eq!(decision.parent_span_id, room.span_id);
        assert!(
            room.attributes
                .iter()
                .any(|attribute| attribute.key == "room")
        );
        assert!(spans.try_recv().is_err());
    }
}
