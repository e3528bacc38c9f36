//! The latest hint of a room: being computed, or given. A request that is repeated, because its
//! response was lost, gets the same one. Which hints there may be is the core's business.

use chefshat_engine::Seat;
use chefshat_room::HintError;

use super::message::{Reply, RoomError};
use chefshat_admission::limits::Hint;

/// Where the answer to a request for a hint goes.
pub(super) type HintReply = Reply<Hint, HintError>;

/// A request for a hint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct HintRequest {
    pub(super) seat: Seat,
    /// Number of the decision, per seat, from 1.
    pub(super) decision: u64,
    /// Chosen by the client; `None`: it is not repeated.
    pub(super) id: Option<[u8; 32]>,
}

/// The latest hint.
#[derive(Debug, Default)]
pub(super) struct LatestHint(Option<Asked>);

#[derive(Debug)]
struct Asked {
    request: HintRequest,
    /// The caller, until it is answered.
    reply: Option<HintReply>,
    /// Once it has been given.
    hint: Option<Hint>,
}

impl LatestHint {
    /// Handles a request that repeats that of the latest hint: returns that hint, or answers the
    /// newest caller once there is one. Any other request is handed back.
    pub(super) fn repeat(
        &mut self,
        request: HintRequest,
        reply: HintReply,
    ) -> Result<Option<(HintReply, Hint)>, HintReply> {
        let same = |asked: &&mut Asked| request.id.is_some() && asked.request == request;
        let Some(asked) = self.0.as_mut().filter(same) else {
            return Err(reply);
        };
        if let Some(hint) = &asked.hint {
            return Ok(Some((reply, hint.clone())));
        }
        if let Some(before) = asked.reply.replace(reply) {
            refuse(before, HintError::TooMany);
        }
        Ok(None)
    }

    /// A hint is being computed.
    pub(super) fn started(&mut self, request: HintRequest, reply: HintReply) {
        let asked = Asked {
            request,
            reply: Some(reply),
            hint: None,
        };
        if let Some(before) = self.0.replace(asked).and_then(|asked| asked.reply) {
            refuse(before, HintError::Closed);
        }
    }

    /// A hint has been computed; `given` says whether it is given. Returns who waits for it.
    pub(super) fn ended(
        &mut self,
        request: HintRequest,
        hint: Option<Hint>,
        given: Result<(), HintError>,
    ) -> Option<(HintReply, Hint)> {
        let asked = self.0.as_mut().filter(|asked| asked.request == request)?;
        let reply = asked.reply.take();
        match (hint, given) {
            (Some(hint), Ok(())) => {
                asked.hint = Some(hint.clone());
                Some((reply?, hint))
            }
            (hint, given) => {
                self.0 = None;
                if let (Some(_), Err(error), Some(reply)) = (hint, given, reply) {
                    refuse(reply, error);
                }
                None
            }
        }
    }
}

fn refuse(reply: HintReply, error: HintError) {
    // The caller may be gone.
    let _ = reply.send(Err(RoomError::Refused(error)));
}

#[cfg(test)]
mod tests {
    use chefshat_engine::ActionId;
    use tokio::sync::oneshot;

    use super::*;

    const ASKED: HintRequest = HintRequest {
        seat: Seat::new(1),
        decision: 4,
        id: Some([7; 32]),
    };

    fn hint() -> Hint {
        Hint {
            suggested: ActionId::new(199),
            estimates: Vec::new(),
        }
    }

    #[test]
    fn a_repeated_request_gets_the_same_hint() {
        let mut latest = LatestHint::default();
        let (reply, mut first) = oneshot::channel();
        let reply = latest.repeat(ASKED, reply).expect_err("nothing to repeat");
        latest.started(ASKED, reply);
        // The newest caller waits.
        let (reply, mut second) = oneshot::channel();
        assert!(latest.repeat(ASKED, reply).expect("the same").is_none());
        let refused = first.try_recv().expect("an answer").expect_err("refused");
        assert_eq!(refused, RoomError::Refused(HintError::TooMany));
        let (reply, hint) = latest.ended(ASKED, Some(hint()), Ok(())).expect("a caller");
        let _ = reply.send(Ok(hint));
        assert!(second.try_recv().is_ok());
        // After the hint was given.
        let (reply, _third) = oneshot::channel();
        let given = latest.repeat(ASKED, reply).expect("the same");
        assert_eq!(given.expect("a hint").1.suggested, ActionId::new(199));
    }

    #[test]
    fn other_requests_are_new() {
        let mut latest = LatestHint::default();
        let (reply, _caller) = oneshot::channel();
        latest.started(ASKED, reply);
        let others = [
            HintRequest {
                decision: 5,
                ..ASKED
            },
            HintRequest {
                seat: Seat::new(2),
                ..ASKED
            },
            HintRequest {
                id: Some([8; 32]),
                ..ASKED
            },
            HintRequest { id: None, ..ASKED },
        ];
        for other in others {
            let (reply, _caller) = oneshot::channel();
            assert!(latest.repeat(other, reply).is_err(), "{other:?}");
        }
        // Requests without an id are never the same.
        let (reply, _caller) = oneshot::channel();
        latest.started(others[3], reply);
        let (reply, _caller) = oneshot::channel();
        assert!(latest.repeat(others[3], reply).is_err());
    }

    #[test]
    fn a_caller_hears_that_its_decision_is_closed() {
        let mut latest = LatestHint::default();
        for closed_by_end in [true, false] {
            let (reply, mut caller) = oneshot::channel();
            latest.started(ASKED, reply);
            if closed_by_end {
                let ended = latest.ended(ASKED, Some(hint()), Err(HintError::Closed));
                assert!(ended.is_none());
            } else {
                let (reply, _other) = oneshot::channel();
                latest.started(
                    HintRequest {
                        decision: 5,
                        ..ASKED
                    },
                    reply,
                );
                assert!(latest.ended(ASKED, Some(hint()), Ok(())).is_none());
            }
            let refused = caller.try_recv().expect("an answer").expect_err("refused");
            assert_eq!(refused, RoomError::Refused(HintError::Closed));
        }
    }
}
