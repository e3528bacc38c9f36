//! Gathers the rows of a record while verifying it.
//!
//! Rewards: the row of a turn has the reward of that turn, including for finishing. Rewards at the
//! end of a Shift (the finishing part of the last seat, points) are added to the seat's last turn
//! of that Shift. A seat without a turn in a Shift has no row for them.

use std::sync::Arc;

use chefshat_engine::{Action, ActionId, BySeat, Game, RewardScheme, Seat, Viewer};
use chefshat_proto::v1::{self, DecisionKind, DecisionSource, game_event::Kind, record_line::Line};

use super::decisions::{DecisionRow, RECORDED, Rewards};
use super::expressions::{ExpressionRow, LatestExpression};
use super::game::{GameInfo, IMPORTED, SeatInfo, checked_info};
use super::markers::MarkerRow;
use chefshat_record::convert::PERSON_TIME_KEY;
use chefshat_record::jsonl::Record;
use chefshat_record::replay::{Moment, ReplayError, walk_file};

/// The rows of one game.
#[derive(Debug)]
pub(super) struct GameRows {
    pub(super) game: Arc<GameInfo>,
    pub(super) decisions: Vec<DecisionRow>,
    pub(super) expressions: Vec<ExpressionRow>,
    pub(super) markers: Vec<MarkerRow>,
}

/// Verifies a record and gathers its rows.
///
/// # Errors
/// The first wrong line.
pub(super) fn gather(record: &Record) -> Result<GameRows, ReplayError> {
    let game = Arc::new(checked_info(&record.lines)?);
    let mut gatherer = Gatherer::new(Arc::clone(&game));
    let replayed = walk_file(record, |moment| gatherer.take(moment))?;
    if let Some(key) = replayed.signed_by {
        game.signed_by.get_or_init(|| key.to_string());
    }
    match gatherer.problem {
        Some(problem) => Err(problem),
        None => Ok(gatherer.rows),
    }
}

/// Whether the gifts of a seat are known.
#[derive(Debug, Clone, Copy, Default)]
struct KnownGifts {
    gave: bool,
    received: bool,
}

/// Gathers the rows of a game.
struct Gatherer {
    rows: GameRows,
    /// The first row of the current Shift.
    shift_from: usize,
    /// The row of each seat's last turn in the Shift.
    last_turn: BySeat<Option<usize>>,
    /// The number of seats that finished in the Shift.
    finished: u8,
    /// Known gifts of the Shift's exchange.
    known_gifts: BySeat<KnownGifts>,
    /// The current participants, which can change before the game.
    participants: Vec<Option<Arc<SeatInfo>>>,
    latest: Vec<Option<LatestExpression>>,
    problem: Option<ReplayError>,
}

impl Gatherer {
    fn new(game: Arc<GameInfo>) -> Self {
        let players = game.seats.len();
        let built_in = |seat: &Arc<SeatInfo>| seat.built_in.is_some().then(|| seat.clone());
        Self {
            participants: game.seats.iter().map(built_in).collect(),
            rows: GameRows {
                game,
                decisions: Vec::new(),
                expressions: Vec::new(),
                markers: Vec::new(),
            },
            shift_from: 0,
            last_turn: BySeat::filled(players, None),
            finished: 0,
            known_gifts: BySeat::filled(players, KnownGifts::default()),
            latest: vec![None; players],
            problem: None,
        }
    }

    fn take(&mut self, moment: Moment<'_>) {
        match moment.entry {
            Line::Decision(record) => {
                if let Some(game) = moment.game {
                    self.decision(record, game, &moment);
                }
            }
            Line::Event(event) => match &event.kind {
                Some(Kind::Seated(seated)) => {
                    // The record says it of the last participant of the seat; it holds for all.
                    let seats = self.rows.game.seats.get(seated.seat as usize);
                    let info = match seats.and_then(|seat| seat.shown_kind) {
                        Some(_) => SeatInfo::wizard(&seated.name, seated.kind()),
                        None => SeatInfo::new(&seated.name, seated.kind(), ""),
                    };
                    self.set_participant(seated.seat, Some(info));
                }
                Some(Kind::Vacated(vacated)) => self.set_participant(vacated.seat, None),
                Some(Kind::ShiftStarted(_)) => {
                    // Only records of games with real cards lack some.
                    let all = !self.rows.game.real_cards;
                    let known_gifts = KnownGifts {
                        gave: all,
                        received: all,
                    };
                    self.known_gifts = BySeat::filled(self.known_gifts.len(), known_gifts);
                }
                Some(Kind::CardsExchanged(exchanged)) if !exchanged.cards.is_empty() => {
                    self.known_gifts[Seat::new(exchanged.giver as usize)].gave = true;
                    self.known_gifts[Seat::new(exchanged.receiver as usize)].received = true;
                }
                Some(Kind::SeatFinished(finished)) => self.seat_finished(finished),
                Some(Kind::ShiftEnded(ended)) => self.shift_ended(ended),
                Some(Kind::GameEnded(ended)) => self.game_ended(ended),
                Some(Kind::ExpressionShown(shown)) => {
                    let expression = shown.expression.as_ref();
                    self.expression(moment.line, shown.seat, event.elapsed_ms, expression, true);
                }
                _ => {}
            },
            Line::PrivateExpression(private) => {
                let expression = private.expression.as_ref();
                self.expression(
                    moment.line,
                    private.seat,
                    private.elapsed_ms,
                    expression,
                    false,
                );
            }
            Line::Marker(marker) => self.rows.markers.push(MarkerRow {
                game: Arc::clone(&self.rows.game),
                decisions_before: self.rows.decisions.len() as u64,
                marker: marker.clone(),
            }),
            Line::Header(_) | Line::Footer(_) => {}
        }
    }

    /// Changes the participant of a seat, dropping the last expression.
    fn set_participant(&mut self, seat: u32, participant: Option<SeatInfo>) {
        let seat = seat as usize;
        if let (Some(current), Some(latest)) =
            (self.participants.get_mut(seat), self.latest.get_mut(seat))
        {
            *current = participant.map(Arc::new);
            *latest = None;
        }
    }

    fn decision(&mut self, record: &v1::DecisionRecord, game: &Game, moment: &Moment<'_>) {
        let info = Arc::clone(&self.rows.game);
        let rules = info.rule_set;
        let seat = Seat::new(record.seat as usize);
        let seen = game.observe(Viewer::Seat(seat));
        let action = ActionId::new(u16::try_from(record.action).expect("a decision that replays"));
        let is_turn = record.kind() == DecisionKind::Turn;
        let mut rewards = Rewards::default();
        let mut invalid_rewards = Rewards::default();
        if is_turn {
            let shed = match rules.actions().decode(action) {
                Some(Action::Play {
                    quantity, jokers, ..
                }) => quantity + jokers,
                Some(Action::LoneJoker) => 1,
                _ => 0,
            };
            let left = seen.cards_left[seat].saturating_sub(shed);
            rewards = RewardScheme::ALL.map(|scheme| scheme.turn(&rules, left, None));
            let attempts = record.invalid_attempts.len() as f32;
            // Added to zero to avoid a negative zero.
            invalid_rewards = RewardScheme::ALL.map(|scheme| 0.0 + attempts * scheme.invalid());
            self.last_turn[seat] = Some(self.rows.decisions.len());
        }
        let built_in = info.seats[seat.index()].built_in.is_some();
        let untimed = info.origin == IMPORTED && record.decision_time_us == 0;
        let measured = !built_in
            && !untimed
            && !matches!(
                record.source(),
                DecisionSource::Substitute | DecisionSource::Recorded
            );
        self.rows.decisions.push(DecisionRow {
            game: info,
            hand_known: moment.hands_known[seat],
            golden_known: moment.golden_known[seat],
            gave_known: self.known_gifts[seat].gave,
            received_known: self.known_gifts[seat].received,
            number: self.rows.decisions.len() as u64 + 1,
            decision_id: record.decision_id,
            turn: is_turn.then(|| game.shift_turns() + 1),
            phase: match record.kind() {
                DecisionKind::Unspecified | DecisionKind::Turn => "turn",
                DecisionKind::Exchange => "exchange",
                DecisionKind::SpecialAction => "special_action",
            },
            seat: seat.index(),
            mask: game.legal_actions(),
            action: action.index(),
            text: record.text.clone(),
            invalid_attempts: record.invalid_attempts.clone(),
            source: source_name(record.source()),
            hinted: record.hints > 0,
            decision_time_us: measured.then_some(record.decision_time_us),
            person_decision_time_ms: (record.annotations.as_ref())
                .and_then(|it| it.extra.get(PERSON_TIME_KEY)?.parse().ok()),
            elapsed_ms: record.elapsed_ms,
            expressions: self.latest.clone(),
            rewards,
            invalid_rewards,
            shift_points: None,
            shift_place: None,
            game_points: None,
            game_place: None,
            seen,
        });
    }

    /// Rewards the last turn of a seat that finished.
    fn seat_finished(&mut self, finished: &v1::SeatFinished) {
        self.finished += 1;
        let seat = Seat::new(finished.seat as usize);
        let place = u8::try_from(finished.place).expect("a place of an event that replays");
        if let Some(row) = self.last_turn[seat] {
            let rules = self.rows.game.rule_set;
            self.rows.decisions[row].rewards =
                RewardScheme::ALL.map(|scheme| scheme.turn(&rules, 0, Some(place)));
        }
    }

    fn shift_ended(&mut self, ended: &v1::ShiftEnded) {
        for (&number, place) in ended.order.iter().zip(1u8..) {
            let seat = Seat::new(number as usize);
            let points = ended.shift_points[seat.index()];
            for row in &mut self.rows.decisions[self.shift_from..] {
                if row.seat == seat.index() {
                    row.shift_points = Some(points);
                    row.shift_place = Some(place);
                }
            }
            let Some(last) = self.last_turn[seat] else {
                continue;
            };
            let rewards = &mut self.rows.decisions[last].rewards;
            for (reward, scheme) in rewards.iter_mut().zip(RewardScheme::ALL) {
                *reward += scheme
                    .shift_end(place, points, place <= self.finished)
                    .unwrap_or(0.0);
            }
        }
        self.shift_from = self.rows.decisions.len();
        self.last_turn = BySeat::filled(self.last_turn.len(), None);
        self.finished = 0;
    }

    fn game_ended(&mut self, ended: &v1::GameEnded) {
        for standing in &ended.standings {
            for row in &mut self.rows.decisions {
                if row.seat == standing.seat as usize {
                    row.game_points = Some(standing.points);
                    row.game_place = u8::try_from(standing.place).ok();
                }
            }
        }
    }

    fn expression(
        &mut self,
        line: usize,
        seat: u32,
        elapsed_ms: u64,
        expression: Option<&v1::Expression>,
        public: bool,
    ) {
        let seat = seat as usize;
        let (Some(latest), Some(expression)) = (self.latest.get_mut(seat), expression) else {
            self.problem.get_or_insert_with(|| ReplayError {
                line,
                problem: "the expression has an invalid seat or no content".into(),
            });
            return;
        };
        *latest = Some(LatestExpression {
            expression: Arc::new(expression.clone()),
            public,
            elapsed_ms,
        });
        self.rows.expressions.push(ExpressionRow {
            game: Arc::clone(&self.rows.game),
            seat,
            player: self.participants[seat].clone(),
            elapsed_ms,
            decisions_before: self.rows.decisions.len() as u64,
            public,
            expression: expression.clone(),
        });
    }
}

fn source_name(source: DecisionSource) -> &'static str {
    match source {
        DecisionSource::Unspecified | DecisionSource::Agent => "agent",
        DecisionSource::Timeout => "timeout",
        DecisionSource::Invalid => "invalid",
        DecisionSource::Disconnected => "disconnected",
        DecisionSource::Substitute => "substitute",
        DecisionSource::Recorded => RECORDED,
        DecisionSource::Table => "table",
    }
}
