//! Decision requests, the agent's answers, their results, and interferences with them.

use std::time::Duration;

use chefshat_proto::v1::{self, seat_command::Command, seat_update::Update};

use super::seats::{DecisionState, SeatKey};
use super::{Exam, Interference, Passed, Phase, StreamId};
use crate::fault::Fault;

/// Answers to a closed decision that may be on their way when the agent receives the result.
const CROSSING_ANSWERS: u32 = 1;
/// Lost decisions after which a case with short deadlines is ended, if more are lost than answered.
const HURRIED_LOSSES: u32 = 8;
/// Answered decisions between two interferences.
const QUIET_DECISIONS: u32 = 1;

impl Exam {
    /// A decision is requested from the agent.
    pub(super) fn decision_requested(
        &mut self,
        key: &SeatKey,
        handle: u32,
        request: &mut v1::DecisionRequest,
        passed: &mut Passed,
    ) {
        let seen = self.seats.entry(key.clone()).or_default();
        let held: Vec<v1::Answer> = (seen.decisions.range_mut(..request.decision_id))
            .filter_map(|(_, decision)| decision.held.take())
            .collect();
        // Its time is up: the server may receive it now.
        passed
            .to_server
            .extend(held.into_iter().map(|answer| v1::SeatCommand {
                handle,
                command: Some(Command::Answer(answer)),
            }));
        self.settle_before(key, request.decision_id);
        let seen = self.seats.entry(key.clone()).or_default();
        seen.decision_requested(request);
        if seen.no_mask {
            request.action_mask.clear();
        }
    }

    /// Judges earlier decisions that ended without a result.
    pub(super) fn settle_before(&mut self, key: &SeatKey, next: u64) {
        let Some(seen) = self.seats.get_mut(key) else {
            return;
        };
        let mut unanswered = None;
        for (id, decision) in seen.decisions.range_mut(..next) {
            let open = matches!(decision.state, DecisionState::Open | DecisionState::Refused);
            if !open
                || decision.lost_noted
                || decision.tampered && decision.state == DecisionState::Open
            {
                continue;
            }
            decision.lost_noted = true;
            decision.state = DecisionState::Closed;
            seen.lost += 1;
            unanswered = Some((*id, decision.kind));
        }
        let Some((id, kind)) = unanswered else { return };
        if self.case.hurried {
            return self.check_losses(key);
        }
        let got = format!(
            "decision {id} ({}) was not answered in time",
            kind_in_words(kind)
        );
        self.failed(Fault::NotAnswered, "an answer to every decision", got);
    }

    /// Ends a case with short deadlines once its outcome is clear.
    pub(super) fn check_losses(&mut self, key: &SeatKey) {
        let Some(seen) = self.seats.get(key) else {
            return;
        };
        let (lost, taken, late) = (seen.lost, seen.taken, seen.late);
        let enough = lost >= HURRIED_LOSSES || seen.over;
        if self.case.hurried && enough && lost > taken {
            let all = lost + taken;
            let (fault, why) = match late {
                0 => (Fault::NotAnswered, "none of these was answered"),
                _ => (Fault::TooSlow, "answers to them came too late"),
            };
            self.failed(
                fault,
                "most answers within the time for a decision",
                format!("the time of {lost} of {all} decisions ran out, and {why}"),
            );
        }
    }

    /// The agent answers.
    pub(super) fn answer(
        &mut self,
        stream: StreamId,
        key: SeatKey,
        handle: u32,
        answer: v1::Answer,
        now: Duration,
        passed: &mut Passed,
    ) {
        let id = answer.decision_id;
        let Some(seen) = self.seats.get_mut(&key) else {
            return;
        };
        let newest = seen.newest();
        let own = seen.own && self.phase == Phase::Playing;
        let plays_on = id > seen.read_after && id <= newest;
        let dropping = own && self.dropping;
        if plays_on {
            self.demand
                .take_if(|demand| demand.fault == Fault::StoppedAfterClosed);
        }
        let tampers = match seen.decisions.get_mut(&id) {
            None => {
                // Decisions requested too long ago are forgotten.
                if id > newest {
                    self.unrequested_answer(id, newest);
                }
                false
            }
            Some(decision) if decision.closed_received => {
                decision.after_closed += 1;
                let times = decision.after_closed;
                if times > CROSSING_ANSWERS {
                    self.fault(
                        Fault::RepeatedAfterClosed,
                        "no more answers to a decision whose result is CLOSED",
                        format!("{times} more answers to decision {id}"),
                    );
                }
                false
            }
            Some(decision) => match decision.state {
                DecisionState::Taken | DecisionState::Answered => {
                    let action = answer.action;
                    self.fault(
                        Fault::AnsweredTwice,
                        "one answer to a decision",
                        format!("another answer to decision {id}, action {action}"),
                    );
                    false
                }
                // It was on its way when the time ran out.
                DecisionState::Closed => {
                    seen.late += 1;
                    false
                }
                DecisionState::Open | DecisionState::Refused => {
                    decision.state = DecisionState::Answered;
                    decision.tampered |= dropping;
                    let choice = decision.legal_count() > 1;
                    let turn = decision.kind == v1::DecisionKind::Turn;
                    let legal = self.judge_action(&key, &answer);
                    legal && own && choice && turn && id == newest
                }
            },
        };
        if dropping {
            return;
        }
        if tampers {
            self.tamper(stream, &key, handle, answer, now, passed);
        } else {
            passed.to_server.push(to_server(handle, answer));
        }
    }

    fn unrequested_answer(&mut self, id: u64, newest: u64) {
        let got = match newest {
            0 => format!("an answer to decision {id} before any was requested"),
            _ => format!("an answer to decision {id}, when {newest} was the newest requested"),
        };
        let expected = "answers to decisions that were requested";
        self.fault(Fault::AnsweredUnasked, expected, got);
    }

    /// Judges the action of an answer to an open decision; returns whether it is legal.
    fn judge_action(&mut self, key: &SeatKey, answer: &v1::Answer) -> bool {
        let (id, action) = (answer.decision_id, answer.action);
        let seen = self.seats.get(key);
        let Some((seen, decision)) = seen.and_then(|seen| Some((seen, seen.decisions.get(&id)?)))
        else {
            return false;
        };
        let size = match seen.actions {
            0 => u32::try_from(8 * decision.mask.len()).unwrap_or(u32::MAX),
            actions => actions,
        };
        let (legal, kind) = (decision.is_legal(action), kind_in_words(decision.kind));
        if action >= size {
            self.fault(
                Fault::ActionOutOfSpace,
                format!("an action below {size}"),
                format!("action {action} at decision {id}"),
            );
        } else if !legal {
            self.fault(
                Fault::IllegalAction,
                "an action of the mask",
                format!("action {action} at decision {id} ({kind}), which is not legal there"),
            );
        }
        legal
    }

    /// Handles a legal answer at a turn with a choice: forwards it, or interferes.
    fn tamper(
        &mut self,
        stream: StreamId,
        key: &SeatKey,
        handle: u32,
        mut answer: v1::Answer,
        now: Duration,
        passed: &mut Passed,
    ) {
        let quiet = self.quiet >= QUIET_DECISIONS;
        self.quiet += 1;
        let decision = (self.seats.get_mut(key))
            .and_then(|seen| seen.decisions.get_mut(&answer.decision_id))
            .expect("the answer is to a requested decision");
        match self.plan.front() {
            Some(Interference::Refuse) if quiet => {
                let illegal = (0..).find(|action| !decision.is_legal(*action));
                let illegal = illegal.expect("a mask has an end");
                decision.swapped = Some((illegal, answer.action));
                answer.action = illegal;
                passed.to_server.push(to_server(handle, answer));
                self.interfered();
            }
            Some(Interference::CutBeforeAnswer) if quiet => {
                decision.tampered = true;
                self.interfered();
                self.cut(stream, now);
            }
            Some(Interference::Restart) if quiet => {
                decision.tampered = true;
                self.interfered();
                self.restart();
            }
            Some(Interference::HoldAnswer) if quiet => {
                decision.tampered = true;
                decision.held = Some(answer);
                self.interfered();
            }
            Some(Interference::DropAnswers) if quiet => {
                // Until the substitute plays, this and the following answers are dropped.
                decision.tampered = true;
                self.dropping = true;
            }
            _ => passed.to_server.push(to_server(handle, answer)),
        }
    }

    /// Whether the connection is cut instead of sending this message.
    pub(super) fn cuts_instead(
        &mut self,
        stream: StreamId,
        response: &v1::PlayResponse,
        now: Duration,
    ) -> bool {
        if self.phase != Phase::Playing || self.quiet < QUIET_DECISIONS {
            return false;
        }
        let plan = self.plan.front().copied();
        let bound = &self.streams[stream].bound;
        let cut = response.updates.iter().find_map(|update| {
            let key = bound.get(&update.handle)?;
            let newest = self.seats.get(key).filter(|seen| seen.own)?.newest();
            let cut = match (&update.update, plan) {
                (Some(Update::Decision(request)), Some(Interference::CutBeforeRequest)) => {
                    request.kind() == v1::DecisionKind::Turn && request.decision_id > newest
                }
                (Some(Update::Result(result)), Some(Interference::CutBeforeResult)) => {
                    result.status() == v1::AnswerStatus::Accepted && result.decision_id == newest
                }
                _ => false,
            };
            cut.then(|| key.clone())
        });
        if cut.is_none() {
            return false;
        }
        self.interfered();
        self.cut(stream, now);
        true
    }

    /// The agent receives the result of an answer.
    pub(super) fn result(&mut self, key: &SeatKey, result: &mut v1::AnswerResult) {
        let id = result.decision_id;
        if result.annotations_dropped {
            self.fault(
                Fault::AnnotationsDropped,
                "annotations within their limits",
                format!("annotations of decision {id} were dropped"),
            );
        }
        let Some(seen) = self.seats.get_mut(key) else {
            return;
        };
        let Some(decision) = seen.decisions.get_mut(&id) else {
            return;
        };
        match result.status() {
            v1::AnswerStatus::Accepted => {
                decision.state = DecisionState::Taken;
                seen.taken += 1;
                self.fulfil(Fault::GaveUpWhenRefused);
            }
            v1::AnswerStatus::Invalid => {
                let exhausted = result.invalid_attempts_left == Some(0);
                decision.state = if exhausted {
                    DecisionState::Closed
                } else {
                    DecisionState::Refused
                };
                let swapped = decision.swapped.take();
                if let Some((_, own)) = swapped.filter(|(sent, _)| *sent == result.action) {
                    result.action = own;
                    result.detail =
                        "the examiner replaced your action by an illegal one: answer again".into();
                    self.demand(
                        Fault::GaveUpWhenRefused,
                        "another answer to the decision after INVALID",
                        None,
                    );
                }
            }
            v1::AnswerStatus::Closed => {
                decision.closed_received = true;
                let tampered = decision.tampered;
                if decision.state != DecisionState::Answered {
                    return;
                }
                decision.state = DecisionState::Closed;
                if tampered {
                    // Decisions requested before this result may be answered without having read
                    // it.
                    seen.read_after = seen.newest();
                    self.demand(
                        Fault::StoppedAfterClosed,
                        "the agent to continue after an answer came too late",
                        None,
                    );
                } else if !std::mem::replace(&mut decision.lost_noted, true) {
                    seen.lost += 1;
                    seen.late += 1;
                    if self.case.hurried {
                        return self.check_losses(key);
                    }
                    self.fault(
                        Fault::TooSlow,
                        "answers within the time for a decision",
                        format!("the answer to decision {id} arrived too late"),
                    );
                }
            }
            v1::AnswerStatus::UnknownDecision | v1::AnswerStatus::Unspecified => {}
        }
    }
}

fn to_server(handle: u32, answer: v1::Answer) -> v1::SeatCommand {
    v1::SeatCommand {
        handle,
        command: Some(Command::Answer(answer)),
    }
}

fn kind_in_words(kind: v1::DecisionKind) -> &'static str {
    match kind {
        v1::DecisionKind::Turn => "a turn",
        v1::DecisionKind::Exchange => "a card for the exchange",
        v1::DecisionKind::SpecialAction => "a special action",
        v1::DecisionKind::Unspecified => "of an unknown kind",
    }
}
