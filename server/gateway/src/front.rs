//! What stands in front of the services: it looks at each request, and answers it alone or with them.
//! Layers differ in this alone.

use std::task::{Context, Poll};

use http::{Request, Response};
use tonic::body::Body;
use tower::{Layer, Service};

/// What looks at the requests for the services `S`, which have a body `B`.
pub trait Front<S: Service<Request<B>>, B> {
    /// The answer to come.
    type Answering: Future<Output = Result<Response<Body>, S::Error>>;

    /// Answers a request, alone or with the services, which are ready for one.
    fn answer(&self, services: &mut S, request: Request<B>) -> Self::Answering;
}

/// Puts something in front of the services.
#[derive(Debug, Clone, Copy)]
pub struct InFront<F>(pub F);

impl<F: Clone, S> Layer<S> for InFront<F> {
    type Service = Fronted<F, S>;

    fn layer(&self, services: S) -> Fronted<F, S> {
        Fronted {
            front: self.0.clone(),
            services,
        }
    }
}

/// The services with something in front of them.
#[derive(Debug, Clone)]
pub struct Fronted<F, S> {
    front: F,
    services: S,
}

impl<F, S, B> Service<Request<B>> for Fronted<F, S>
where
    F: Front<S, B>,
    S: Service<Request<B>>,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = F::Answering;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.services.poll_ready(context)
    }

    fn call(&mut self, request: Request<B>) -> F::Answering {
        self.front.answer(&mut self.services, request)
    }
}

/// Takes the services that are ready for a request, which is passed on later, and leaves a clone.
pub fn take_ready<S: Clone>(services: &mut S) -> S {
    let clone = services.clone();
    std::mem::replace(services, clone)
}
