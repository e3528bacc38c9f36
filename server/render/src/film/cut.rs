//! Turns the lines of a record into frames.

use std::time::Duration;

use chefshat_engine::{BySeat, Game, Seat, SeatOrder, Viewer};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

use super::super::card::Card;
use super::super::chronicle::{Chronicle, play_cards};
use super::super::scene::{Hand, Now, Scene};
use chefshat_record::convert::{rules_from_proto, seat_from_number};
use chefshat_record::replay::Moment;

/// A moment of a game.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum When {
    /// This decision is open, counted over the game from 1.
    Decision(u64),
    /// This Shift has just ended.
    ShiftEnd(u32),
    /// The game has ended.
    End,
}

/// A scene and its duration.
#[derive(Debug, Clone)]
pub struct Frame {
    /// The moment.
    pub when: When,
    /// The scene.
    pub scene: Scene,
    /// Decision time; zero for built-in agents and at the ends of Shifts and games.
    pub decision_time: Duration,
}

/// The chronicle of a record; `None` if its rules are invalid, which the replay rejects.
pub(super) fn chronicle_of(header: &v1::RecordHeader, viewer: Viewer) -> Option<Chronicle> {
    let rules = rules_from_proto(header.rules.as_ref()?).ok()?;
    Some(Chronicle::new(
        &header.room_name,
        &header.seats,
        &rules,
        viewer,
    ))
}

/// A film being made.
pub(super) struct Cut {
    viewer: Viewer,
    chronicle: Option<Chronicle>,
    pub(super) frames: Vec<Frame>,
    pub(super) decisions: u64,
    pub(super) shifts: u32,
    /// The play of the last decision.
    last_play: Option<v1::Play>,
    /// Whether a Shift is in progress.
    dealt: bool,
}

impl Cut {
    pub(super) fn new(viewer: Viewer) -> Self {
        Self {
            viewer,
            chronicle: None,
            frames: Vec::new(),
            decisions: 0,
            shifts: 0,
            last_play: None,
            dealt: false,
        }
    }

    /// Processes a line.
    pub(super) fn take(&mut self, moment: &Moment<'_>) {
        match (moment.entry, moment.game) {
            (Line::Header(header), _) => self.chronicle = chronicle_of(header, self.viewer),
            (Line::Decision(decision), Some(game)) => {
                self.decisions += 1;
                self.last_play = None;
                let when = When::Decision(self.decisions);
                let time = Duration::from_micros(decision.decision_time_us);
                self.add_frame(when, game, moment, time);
            }
            (Line::Event(event), game) => {
                let Some(kind) = &event.kind else { return };
                if let Some(chronicle) = &mut self.chronicle {
                    chronicle.note(kind);
                }
                match (kind, game) {
                    (Kind::Play(play), _) => self.last_play = Some(*play),
                    (Kind::ShiftStarted(started), _) => {
                        self.shifts = started.shift;
                        self.dealt = true;
                    }
                    (Kind::ShiftEnded(ended), Some(game)) => {
                        self.end_shift(ended, game);
                        self.dealt = false;
                    }
                    (Kind::GameEnded(_), Some(game)) => self.end_game(game),
                    (Kind::GameAborted(_), Some(game)) => self.abort(game, moment),
                    _ => {}
                }
            }
            _ => {}
        }
    }

    /// Adds a frame, unless its decision is hidden. Only the open perspective gets numbers: a gap
    /// would reveal a declined special action.
    fn add_frame(&mut self, when: When, game: &Game, moment: &Moment<'_>, decision_time: Duration) {
        if let Some(chronicle) = &self.chronicle {
            let mut scene = Scene::of(game, chronicle, self.viewer, &moment.hands_known);
            scene.hide_golden(&moment.golden_known);
            if let When::Decision(decision) = when {
                if scene.now == Now::Dealt {
                    return;
                }
                scene.decision = Some(decision).filter(|_| self.viewer == Viewer::Everything);
            }
            self.frames.push(Frame {
                when,
                scene,
                decision_time,
            });
        }
    }

    /// Adds the frame of an aborted game. At a real table the next Shift may not have been dealt.
    fn abort(&mut self, game: &Game, moment: &Moment<'_>) {
        if self.dealt {
            self.add_frame(When::End, game, moment, Duration::ZERO);
        } else if let Some(mut last) = self.frames.last().cloned() {
            last.when = When::End;
            self.frames.push(last);
        }
        if let Some(last) = self.frames.last_mut() {
            last.scene.now = Now::Aborted;
            for seat in &mut last.scene.seats {
                seat.deciding = false;
            }
        }
    }

    /// Adds the end of a Shift, from the scene of its last decision: the game is already in the
    /// next Shift.
    fn end_shift(&mut self, ended: &v1::ShiftEnded, game: &Game) {
        let (Some(last), Some(chronicle)) = (self.frames.last(), &self.chronicle) else {
            return;
        };
        let players = game.rules().players();
        let order: Vec<Seat> = ended
            .order
            .iter()
            .filter_map(|&number| seat_from_number(number, players))
            .collect();
        let (Some(order), Some(points)) = (
            SeatOrder::from_slice(&order),
            BySeat::from_slice(&ended.shift_points),
        ) else {
            return;
        };
        let mut scene = last.scene.clone();
        if let Some(play) = &self.last_play
            && let Some(seat) = seat_from_number(play.seat, players)
            && let Some(shown) = scene.seats.get_mut(seat.index())
        {
            scene.board = play_cards(play, false);
            scene.board_by = Some(seat);
            shown.hand.take(&scene.board);
            for card in &scene.board {
                let index = card.face().map_or(scene.faces, |face| face - 1);
                if let Some((played, _)) = scene.played.get_mut(usize::from(index)) {
                    *played += 1;
                }
            }
        }
        for (seat, shown) in scene.seats.iter_mut().enumerate() {
            let seat = Seat::new(seat);
            shown.deciding = false;
            shown.place = order.place_of(seat).unwrap_or(0);
            shown.points = ended.points.get(seat.index()).copied().unwrap_or(0);
        }
        scene.log = chronicle.log().cloned().collect();
        scene.turn = ended.turns;
        scene.decision = None;
        scene.now = Now::ShiftOver {
            points,
            adjudicated: ended.adjudicated,
        };
        self.frames.push(Frame {
            when: When::ShiftEnd(ended.shift),
            scene,
            decision_time: Duration::ZERO,
        });
    }

    fn end_game(&mut self, game: &Game) {
        if let (Some(last), Some(standings)) = (self.frames.last(), game.standings()) {
            let mut scene = last.scene.clone();
            for (place, seat, _) in standings.iter() {
                if let Some(shown) = scene.seats.get_mut(seat.index()) {
                    shown.place = place;
                }
            }
            scene.now = Now::GameOver(standings);
            self.frames.push(Frame {
                when: When::End,
                scene,
                decision_time: Duration::ZERO,
            });
        }
    }
}

impl Hand {
    /// Removes the cards of a play.
    fn take(&mut self, play: &[Card]) {
        match self {
            Hand::Open(cards) => {
                for card in play {
                    // The Golden card is played last of its face and sorted first.
                    let same = |held: &Card| held.face() == card.face();
                    if let Some(index) = cards.iter().rposition(same) {
                        cards.remove(index);
                    }
                }
            }
            Hand::Hidden(count) | Hand::Unknown(count) => {
                *count = count.saturating_sub(u8::try_from(play.len()).unwrap_or(u8::MAX));
            }
        }
    }
}
