//! A record in the columns of `Dataset.pkl.csv` of the reference implementation (package
//! `chefshatgym` 2.4), for scripts written for it. Its "match" is a Shift, its "round" a pizza;
//! lists and dictionaries are Python literals. docs/datasets.md lists the differences.

use chefshat_engine::{Board, Cards, Game, Role, Seat, Viewer};
use chefshat_proto::v1::{self, DecisionKind, game_event::Kind, record_line::Line};

use super::game::GameInfo;
use super::python;
use super::sheet::{Row, Sheet};
use chefshat_record::jsonl::Record;
use chefshat_record::replay::{Moment, ReplayError, walk_file};

/// The source of rows without a player.
const SYSTEM: &str = "SYSTEM";

/// Verifies a record and converts it.
///
/// # Errors
/// The first wrong line.
pub(super) fn lay_out(record: &Record, info: &GameInfo) -> Result<Sheet, ReplayError> {
    let mut writer = Writer::new(info);
    let replayed = walk_file(record, |moment| writer.take(moment))?;
    Ok(Sheet {
        rows: writer.rows,
        decisions: replayed.decisions,
    })
}

/// The state before a turn, until its event.
struct Turn {
    pizza: u32,
    /// F+1 counts; `None` if unknown.
    hand: Option<Vec<u8>>,
    board: Board,
    text: String,
    possible: String,
}

struct Writer<'a> {
    info: &'a GameInfo,
    /// The unique names of the players.
    names: Vec<String>,
    rows: Vec<Row>,
    shift: u32,
    turn: Option<Turn>,
    /// The pizza of the last turn, and the last seat to play in it.
    pizza: u32,
    last_to_play: Option<usize>,
    exchanged: Vec<v1::CardsExchanged>,
    special: Option<usize>,
    shifts: u32,
    performance: Vec<f64>,
}

impl<'a> Writer<'a> {
    fn new(info: &'a GameInfo) -> Self {
        let names: Vec<&str> = info.seats.iter().map(|seat| seat.name.as_str()).collect();
        Self {
            info,
            names: python::unique_names(&names, SYSTEM),
            rows: Vec::new(),
            shift: 0,
            turn: None,
            pizza: 0,
            last_to_play: None,
            exchanged: Vec::new(),
            special: None,
            shifts: 0,
            performance: vec![0.0; info.seats.len()],
        }
    }

    fn take(&mut self, moment: Moment<'_>) {
        let Some(game) = moment.game else {
            return;
        };
        let event = match moment.entry {
            Line::Event(event) => event.kind.as_ref(),
            _ => None,
        };
        // The exchange is one row, written after its last event.
        if !matches!(event, Some(Kind::CardsExchanged(_))) {
            self.exchange(&moment, game);
        }
        match (moment.entry, event) {
            (Line::Decision(record), _) => self.decision(record, &moment, game),
            (_, Some(Kind::GameStarted(_))) => self.game_started(),
            (_, Some(Kind::ShiftStarted(started))) => self.shift_started(started, game),
            (_, Some(Kind::SpecialActionDeclared(declared))) => self.special(declared, game),
            (_, Some(Kind::CardsExchanged(exchanged))) => {
                self.exchanged.push((**exchanged).clone());
            }
            (_, Some(Kind::Play(play))) => self.play(play),
            (_, Some(Kind::Pass(pass))) => self.pass(pass),
            (_, Some(Kind::PizzaDone(_))) => self.pizza_done(),
            (_, Some(Kind::ShiftEnded(ended))) => self.shift_ended(ended),
            (_, Some(Kind::GameEnded(ended))) => self.game_ended(ended),
            _ => {}
        }
    }

    /// Adds a row of the Shift; the pizza is 0 outside of pizzas.
    fn row(&mut self, pizza: u32, source: Option<usize>, action: &'static str) -> &mut Row {
        self.rows.push(Row {
            shift: self.shift.to_string(),
            pizza: pizza.to_string(),
            source: source.map_or_else(|| SYSTEM.to_owned(), |seat| self.names[seat].clone()),
            action,
            ..Row::default()
        });
        self.rows.last_mut().expect("a row was just added")
    }

    fn game_started(&mut self) {
        let names = python::list(self.names.iter().map(|name| python::text(name)));
        self.row(0, None, "START_EXPERIMENT").names = names;
    }

    fn shift_started(&mut self, started: &v1::ShiftStarted, game: &Game) {
        self.shift = started.shift;
        self.special = None;
        let roles = self.roles(game);
        let scores = self.by_name(game.scores().values());
        let row = self.row(0, None, "NEW_MATCH");
        row.roles = roles;
        row.game_score = scores;
        let mut hands = vec!["None".to_owned(); self.names.len()];
        for hand in &started.hands {
            if let Some(cell) = hands.get_mut(hand.seat as usize) {
                *cell = python::list(&hand.cards);
            }
        }
        self.row(0, None, "DEAL_CARDS").hands = python::list(hands);
    }

    fn special(&mut self, declared: &v1::SpecialActionDeclared, game: &Game) {
        let seat = declared.seat as usize;
        self.special = Some(seat);
        let roles = self.roles(game);
        let row = self.row(0, Some(seat), "DECLARE_SPECIAL_ACTION");
        row.roles = roles;
        row.description = match declared.action() {
            v1::SpecialAction::FoodFight => "It is food fight!",
            v1::SpecialAction::DinnerIsServed | v1::SpecialAction::Unspecified => "Dinner served!",
        }
        .to_owned();
    }

    /// Adds the row of the exchange. Its description: whether a special action was declared, its
    /// seat, and the gifts of Dishwasher, Waiter, Sous-Chef and Chef.
    fn exchange(&mut self, moment: &Moment<'_>, game: &Game) {
        if self.exchanged.is_empty() {
            return;
        }
        let given: Vec<v1::CardsExchanged> = std::mem::take(&mut self.exchanged);
        let gave = |role: Role| {
            given
                .iter()
                .find(|given| game.roles()[Seat::new(given.giver as usize)] == Some(role))
        };
        let cards = |role| {
            gave(role).map_or_else(
                || "[]".to_owned(),
                |given| match given.cards.is_empty() {
                    true => "None".to_owned(),
                    false => python::list(&given.cards),
                },
            )
        };
        let card = |role| {
            gave(role)
                .and_then(|given| given.cards.first())
                .map_or_else(|| "None".to_owned(), u32::to_string)
        };
        let description = python::list([
            python::boolean(self.special.is_some()).to_owned(),
            self.special
                .map_or_else(|| "-1".to_owned(), |seat| seat.to_string()),
            cards(Role::Dishwasher),
            card(Role::Waiter),
            card(Role::SousChef),
            cards(Role::Chef),
        ]);
        let hands = python::list(game.hands().iter().map(|(seat, hand)| {
            if moment.hands_known[seat] {
                self.hand(&self.counts(*hand))
            } else {
                "None".to_owned()
            }
        }));
        let row = self.row(0, None, "CARD_EXCHANGE");
        row.description = description;
        row.hands = hands;
    }

    fn decision(&mut self, record: &v1::DecisionRecord, moment: &Moment<'_>, game: &Game) {
        if record.kind() != DecisionKind::Turn {
            return;
        }
        let seat = Seat::new(record.seat as usize);
        let seen = game.observe(Viewer::Seat(seat));
        let known = moment.hands_known[seat];
        let space = self.info.rule_set.actions();
        let texts = game.legal_actions();
        let texts = texts.iter().filter_map(|action| space.text(action));
        self.turn = Some(Turn {
            pizza: seen.pizza,
            hand: known.then(|| self.counts(seen.hand)),
            board: seen.board,
            text: record.text.clone(),
            possible: if known {
                python::list(texts.map(|text| python::text(&text)))
            } else {
                String::new()
            },
        });
    }

    fn play(&mut self, play: &v1::Play) {
        let faces = self.info.rule_set.faces();
        let (face, quantity, jokers) = (
            u8::try_from(play.face).expect("a play that replays"),
            u8::try_from(play.quantity).expect("a play that replays"),
            u8::try_from(play.jokers).expect("a play that replays"),
        );
        let after = Board {
            face,
            size: quantity + jokers,
            jokers,
        };
        if let Some(hand) = self.turn.as_mut().and_then(|turn| turn.hand.as_mut()) {
            // A lone joker has face F+1, the index of the jokers, with quantity 0.
            for (card, gone) in [(face - 1, quantity), (faces, jokers)] {
                let left = &mut hand[usize::from(card)];
                *left = left.saturating_sub(gone);
            }
        }
        let seat = play.seat as usize;
        self.discard(seat, Some(after), play.cards_left == 0);
        self.last_to_play = Some(seat);
    }

    fn pass(&mut self, pass: &v1::Pass) {
        self.discard(pass.seat as usize, None, false);
    }

    fn discard(&mut self, seat: usize, after: Option<Board>, finished: bool) {
        let Some(turn) = self.turn.take() else {
            return;
        };
        self.pizza = turn.pizza;
        let hands = turn
            .hand
            .map_or_else(String::new, |counts| self.hand(&counts));
        let board_before = self.board(turn.board);
        let board_after = self.board(after.unwrap_or(turn.board));
        let row = self.row(turn.pizza, Some(seat), "DISCARD");
        row.description = turn.text;
        row.finished = python::boolean(finished);
        row.hands = hands;
        row.board_before = board_before;
        row.board_after = board_after;
        row.possible = turn.possible;
    }

    /// Attributes the pizza to the last seat to play, if any.
    fn pizza_done(&mut self) {
        let maker = self.last_to_play.take();
        self.row(self.pizza, maker, "DECLARE_PIZZA");
    }

    fn shift_ended(&mut self, ended: &v1::ShiftEnded) {
        // The end of a Shift also ends its last pizza.
        self.pizza_done();
        self.shifts += 1;
        for (sum, points) in self.performance.iter_mut().zip(&ended.shift_points) {
            *sum += 10.0 * f64::from(*points) / f64::from(ended.pizzas);
        }
        let players = self.names.len();
        let mut roles = vec![String::new(); players];
        for (rank, seat) in ended.order.iter().enumerate() {
            roles[*seat as usize] = python::text(role_name(Some(Role::of_rank(rank, players))));
        }
        let roles = self.by_name(&roles);
        let shift_score = self.by_name(&ended.shift_points);
        let game_score = self.by_name(&ended.points);
        let row = self.row(ended.pizzas, None, "END_MATCH");
        row.roles = roles;
        row.shift_score = shift_score;
        row.game_score = game_score;
    }

    fn game_ended(&mut self, ended: &v1::GameEnded) {
        let mut points = vec![0; self.names.len()];
        for standing in &ended.standings {
            points[standing.seat as usize] = standing.points;
        }
        let game_score = self.by_name(&points);
        let shifts = f64::from(self.shifts.max(1));
        let means = self
            .performance
            .iter()
            .map(|sum| format!("{:?}", sum / shifts));
        let performance = self.by_name(means);
        let last = self.rows.last();
        let roles = last.map_or_else(String::new, |row| row.roles.clone());
        let row = self.row(self.pizza, None, "END_EXPERIMENT");
        row.roles = roles;
        row.game_score = game_score;
        row.performance = performance;
    }

    /// A dictionary from names to values.
    fn by_name(&self, values: impl IntoIterator<Item: ToString>) -> String {
        python::dictionary(self.names.iter().map(String::as_str).zip(values))
    }

    fn roles(&self, game: &Game) -> String {
        self.by_name(
            game.roles()
                .values()
                .map(|role| python::text(role_name(*role))),
        )
    }

    fn counts(&self, cards: Cards) -> Vec<u8> {
        cards.counts(self.info.rule_set.faces()).collect()
    }

    /// The cards of a hand ascending, F+1 for a joker, padded in front with a zero per card
    /// played.
    fn hand(&self, counts: &[u8]) -> String {
        let mut cards: Vec<u8> = Vec::with_capacity(usize::from(self.info.rule_set.hand_size()));
        for (count, card) in counts.iter().zip(1u8..) {
            cards.extend(std::iter::repeat_n(card, usize::from(*count)));
        }
        let gone = usize::from(self.info.rule_set.hand_size()).saturating_sub(cards.len());
        python::list(std::iter::repeat_n(0, gone).chain(cards))
    }

    /// The cards on the board in F slots, jokers as F+1; an empty board has F+2 in the first slot.
    fn board(&self, board: Board) -> String {
        let faces = self.info.rule_set.faces();
        let mut slots = vec![0; usize::from(faces)];
        if board.size == 0 {
            slots[0] = faces + 2;
        }
        let plain = usize::from(board.size - board.jokers);
        let cards = std::iter::repeat_n(board.face, plain)
            .chain(std::iter::repeat_n(faces + 1, usize::from(board.jokers)));
        for (slot, card) in slots.iter_mut().zip(cards) {
            *slot = card;
        }
        python::list(slots)
    }
}

/// The reference's name of a role.
fn role_name(role: Option<Role>) -> &'static str {
    match role {
        None => "",
        Some(Role::Chef) => "Chef",
        Some(Role::SousChef) => "Souschef",
        Some(Role::Cook) => "Cook",
        Some(Role::Waiter) => "Waiter",
        Some(Role::Dishwasher) => "Dishwasher",
    }
}
