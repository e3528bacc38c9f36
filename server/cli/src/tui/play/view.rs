//! Draws a game of `chefshat play`: the table, the hand, the request and the keys. `lobby_view`
//! draws the screen between tournament games.

use chefshat_client::v1;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::app::{App, Dialog, EXPRESSIONS, Hint, Link, MAX_LINE, Open};
use super::keys::key_of;
use super::lobby_view;
use super::part::Part;
use crate::narration::view::End;
use crate::tui::cards;
use crate::tui::cards::Shown;
use crate::tui::theme::{Theme, ingredient};
use crate::tui::view::{draw as draw_table, end_lines, popup};

/// Rows below the table: hand (7), request (2), keys (1).
const ROWS: u16 = 10;
/// Columns of the bar of the clock.
const BAR: u64 = 10;
/// Milliseconds below which the clock is a warning.
const SHORT_MS: u64 = 5_000;

/// Key hints for a turn, an exchange, a special action, and while others decide.
const TURN_KEYS: &str =
    " 1-9 ←→ card  ↑↓ number  j joker  Enter play  p pass  e feeling  ? keys  q leave";
const EXCHANGE_KEYS: &str = " 1-9 ←→ card  J joker  Enter give  e feeling  ? keys  q leave";
const SPECIAL_KEYS: &str = " d declare  n decline  e feeling  ? keys  q leave";
const WAITING_KEYS: &str = " PgUp what happened  e feeling  ? keys  q leave";

const HELP: [&str; 19] = [
    "Be the first to get rid of your cards. A play is cards of one",
    "face, with or without jokers. Its face must be lower than the one",
    "on the board, and it needs at least as many cards. If you pass,",
    "you are out until the next pizza.",
    "",
    "1 … 9, 0  the cards of face 1 … 9, 10; those of higher faces have",
    "          a letter on their edge; again: one more of them",
    "J         the jokers          j     a joker with the cards picked",
    "← →       to another card     Tab   to the next that can be used",
    "↑ ↓       one card more, one fewer",
    "Enter     play (or give) what is picked",
    "p         pass",
    "d, n      declare a special action, or do not",
    "h         a hint, if the room gives them   e   show a feeling",
    "PgUp      earlier events, PgDn later ones",
    "s         in a tournament: the standings",
    "t         say something to the table, if the room allows it",
    "r         take your seat back from a substitute",
    "q         leave; the room's rules say who replaces you",
];

/// Draws everything.
pub(super) fn draw(frame: &mut Frame<'_>, theme: Theme, part: &Part, now_ms: u64) {
    match (&part.game, &part.lobby) {
        (Some(game), _) if !part.peek => draw_game(frame, theme, game, now_ms),
        (_, Some(lobby)) => lobby_view::draw(frame, theme, part, lobby),
        (_, None) => {
            let words = match &part.link {
                Link::Lost(why) => format!(" Connecting, retrying: {why}"),
                _ => " Connecting.".to_owned(),
            };
            frame.render_widget(Paragraph::new(words), frame.area());
        }
    }
    lobby_view::draw_over(frame, theme, part);
}

/// Draws a game.
pub(super) fn draw_game(frame: &mut Frame<'_>, theme: Theme, app: &App, now_ms: u64) {
    let mut status = app.link.words().to_owned();
    if let Some(others) = &app.others {
        status = format!("{others} · {status}");
    }
    let Some(area) = draw_table(frame, theme, &app.table, app.me, &status, &app.log, ROWS) else {
        return;
    };
    let [hand, asked, keys] = Layout::vertical([
        Constraint::Length(ROWS - 3),
        Constraint::Length(2),
        Constraint::Length(1),
    ])
    .areas(area);
    draw_hand(frame, theme, app, hand);
    draw_asked(frame, theme, app, now_ms, asked);
    let words = match app.open.as_ref().map(|open| open.decision.kind()) {
        Some(v1::DecisionKind::SpecialAction) => SPECIAL_KEYS,
        Some(v1::DecisionKind::Exchange) => EXCHANGE_KEYS,
        Some(_) => TURN_KEYS,
        None => WAITING_KEYS,
    };
    frame.render_widget(Paragraph::new(words).style(theme.dim()), keys);
    draw_over(frame, theme, app);
}

fn draw_hand(frame: &mut Frame<'_>, theme: Theme, app: &App, area: Rect) {
    let faces = app.table.faces();
    let place = app.me.and_then(|me| app.table.seat(me));
    let open = app
        .open
        .as_ref()
        .filter(|open| open.decision.kind() != v1::DecisionKind::SpecialAction);
    let shown: Vec<Shown> = match (open, place.and_then(|place| place.hand.as_ref())) {
        (Some(open), _) => shown(open),
        (None, Some(hand)) => hand
            .stacks()
            .into_iter()
            .map(|stack| Shown {
                stack,
                active: app.open.is_some(),
                picked: None,
                along: 0,
                key: None,
            })
            .collect(),
        (None, None) => Vec::new(),
    };
    let count: u32 = shown.iter().map(|it| u32::from(it.stack.count)).sum();
    let title = match count {
        0 => " your hand ".to_owned(),
        count => format!(
            " your hand · {} ",
            crate::numbers::counted(count.into(), "card")
        ),
    };
    let block = theme.boxed(title);
    let inner = block.inner(area);
    frame.render_widget(block, area);
    if shown.is_empty() {
        let words = match place.and_then(|place| place.finished) {
            Some(_) => "You are out of cards.",
            None if awaits_hand(app) => {
                "They appear here when somebody at the table has shown them."
            }
            None => "No cards yet.",
        };
        let lines = vec![Line::default(), Line::from(format!("  {words}"))];
        frame.render_widget(Paragraph::new(lines), inner);
        return;
    }
    let columns = usize::from(inner.width).saturating_sub(1);
    let mut lines = cards::hand(theme, faces, &shown, columns);
    for line in &mut lines {
        line.spans.insert(0, Span::raw(" "));
    }
    frame.render_widget(Paragraph::new(lines), inner);
}

/// The stacks of an open decision, with the selection.
fn shown(open: &Open) -> Vec<Shown> {
    let decision = &open.decision;
    let stacks = decision.stacks.iter().enumerate();
    stacks
        .map(|(at, stack)| Shown {
            stack: *stack,
            active: decision.is_active(at),
            picked: (at == decision.at).then_some(decision.quantity),
            along: if stack.joker && at != decision.at {
                decision.jokers
            } else {
                0
            },
            // The labels of low faces and jokers are their keys.
            key: key_of(*stack)
                .filter(|key| !stack.joker && stack.face.to_string() != key.to_string()),
        })
        .collect()
}

fn draw_asked(frame: &mut Frame<'_>, theme: Theme, app: &App, now_ms: u64, area: Rect) {
    let mut first = vec![Span::styled(
        format!(" {}", asked(app, now_ms)),
        theme.bold(),
    )];
    if let (Some((time, bank)), Some(open)) = (app.clock(now_ms), &app.open) {
        let line: usize = first.iter().map(Span::width).sum();
        let clock = clock(open, time, bank);
        let space = usize::from(area.width).saturating_sub(line + Span::raw(&*clock).width() + 1);
        first.push(Span::raw(" ".repeat(space)));
        let style = if time < SHORT_MS {
            theme.warning()
        } else {
            theme.bold()
        };
        first.push(Span::styled(clock, style));
    }
    let second = match &app.open {
        _ if !app.notice.is_empty() => Span::styled(format!(" ! {}", app.notice), theme.warning()),
        Some(open) if !open.sent => match (&open.hint, open.decision.objection()) {
            (Hint::Asked, _) => Span::raw(" The hint is being computed."),
            (Hint::Given(words), _) => Span::raw(format!(" {words}")),
            (Hint::NotAsked, Some(why)) => Span::styled(format!(" ✕ {why}"), theme.dim()),
            (Hint::NotAsked, None) => Span::raw(what_enter_does(open, app.table.faces())),
        },
        _ => Span::raw(""),
    };
    frame.render_widget(
        Paragraph::new(vec![Line::from(first), Line::from(second)]),
        area,
    );
}

/// The request to the person, or whose turn it is.
fn asked(app: &App, now_ms: u64) -> String {
    if let Link::Lost(why) = &app.link {
        return format!("Connection lost, reconnecting: {why}");
    }
    if app.substituted() {
        return "A substitute plays for you. Press r to take your seat back.".to_owned();
    }
    let Some(open) = &app.open else {
        return waiting(app, now_ms);
    };
    let decision = &open.decision;
    if open.sent {
        return "Sent.".to_owned();
    }
    match decision.kind() {
        v1::DecisionKind::SpecialAction => match decision.request.special_action() {
            v1::SpecialAction::FoodFight => "Two jokers! Food Fight: reverse all roles?",
            v1::SpecialAction::DinnerIsServed => "Two jokers! Dinner is Served: skip the exchange?",
            v1::SpecialAction::Unspecified => "Two jokers! Declare your special action?",
        }
        .to_owned(),
        v1::DecisionKind::Exchange => {
            let gift = decision.request.gift_requirement;
            let receiver = gift.map_or("your partner".to_owned(), |it| app.table.name(it.receiver));
            format!("Give a card to {receiver}: {}?", decision.words())
        }
        _ if !decision.can_play() => "Your turn: you cannot play, pass with p.".to_owned(),
        _ => format!("Your turn: {}?", decision.words()),
    }
}

/// What the game waits for.
fn waiting(app: &App, now_ms: u64) -> String {
    let table = &app.table;
    let awaited = app.awaited.as_ref().filter(|_| table.end.is_none());
    if let Some(words) = awaited.and_then(|awaited| awaited.words(table, now_ms)) {
        return words;
    }
    let first = table.turns == 0 && table.shift > 0;
    match table.turn {
        _ if table.end.is_some() => String::new(),
        _ if !table.started => "The game has not started.".to_owned(),
        _ if awaits_hand(app) => "Your cards are on their way.".to_owned(),
        Some(seat) if app.me != Some(seat) => format!("It is {}'s turn.", table.name(seat)),
        None if first && table.last_order.is_empty() => {
            "Another player opens the Shift.".to_owned()
        }
        None if first => "The others decide: special action, exchange, the first turn.".to_owned(),
        _ => "The others decide.".to_owned(),
    }
}

/// Whether the person's cards are on a physical table and not yet known.
fn awaits_hand(app: &App) -> bool {
    app.me.is_some_and(|me| app.table.awaits_hand(me))
}

/// What Enter does.
fn what_enter_does(open: &Open, faces: u32) -> String {
    let decision = &open.decision;
    if decision.kind() == v1::DecisionKind::SpecialAction {
        let [declare, decline] = match decision.at {
            0 => ["[d declare]", " n decline "],
            _ => [" d declare ", "[n decline]"],
        };
        return format!(" {declare} {decline}   ← → chooses, Enter decides.");
    }
    let name = decision.stacks.get(decision.at);
    let name = name.and_then(|stack| ingredient(stack.face, faces));
    let name = name.map_or_else(String::new, |name| format!(" ({name})"));
    let words = decision.words();
    match (decision.opening(), decision.pass_objection()) {
        (Some(rule), _) => format!(" Enter: {words}{name}. {rule}"),
        (None, None) => format!(" Enter: {words}{name}. p: pass."),
        (None, Some(_)) => format!(" Enter: {words}{name}."),
    }
}

/// The clock: a bar, the time for this decision, the bank.
fn clock(open: &Open, time_ms: u64, bank_ms: u64) -> String {
    let full = u64::from(open.decision.request.time_left_ms).max(1);
    let filled = (time_ms * BAR).div_ceil(full).min(BAR);
    let bar: String = (0..BAR)
        .map(|cell| if cell < filled { '█' } else { '░' })
        .collect();
    format!("{bar} {} · bank {}", time(time_ms), time(bank_ms))
}

/// `1:05` or `9 s`.
fn time(ms: u64) -> String {
    let seconds = ms.div_ceil(1000);
    if seconds < 60 {
        format!("{seconds} s")
    } else {
        format!("{}:{:02}", seconds / 60, seconds % 60)
    }
}

/// Draws the end of the game or a dialog over the table.
fn draw_over(frame: &mut Frame<'_>, theme: Theme, app: &App) {
    let plain = |words: &str| Line::from(words.to_owned());
    if app.log.is_open() {
        return;
    }
    match (&app.table.end, &app.link, app.dialog) {
        (Some(end), ..) => {
            let mut lines = vec![plain("")];
            lines.extend(end_lines(theme, &app.table, end));
            lines.push(plain(""));
            if let Some(standing) = &app.standing {
                lines.push(plain(standing));
            } else {
                lines.push(plain(&format!("game {}", app.table.game_id)));
            }
            lines.push(plain(""));
            lines.push(Line::from(Span::styled(app.then, theme.dim())));
            let title = match end {
                End::Finished(_) => "the game is over",
                End::Aborted(_) => "no result",
            };
            popup(frame, theme, title, lines);
        }
        (None, Link::Over(why), _) => {
            let why = why
                .clone()
                .unwrap_or_else(|| "the seat has left the table".to_owned());
            popup(
                frame,
                theme,
                "the seat is lost",
                vec![plain(&why), plain(""), plain(app.then)],
            );
        }
        (None, _, Some(Dialog::Help)) => {
            let mut lines: Vec<Line<'_>> = HELP.iter().map(|line| plain(line)).collect();
            lines.push(Line::from(Span::styled("any key returns", theme.dim())));
            popup(frame, theme, "help", lines);
        }
        (None, _, Some(Dialog::Leave)) => popup(
            frame,
            theme,
            "leave",
            vec![
                plain("Leave the table? The room's rules say who replaces you."),
                plain(""),
                plain("y: leave; any other key: stay"),
            ],
        ),
        (None, _, Some(Dialog::Express)) => {
            let lines = (1..)
                .zip(EXPRESSIONS)
                .map(|(key, (label, ..))| plain(&format!("{key}  {label}")));
            popup(frame, theme, "show the table", lines.collect());
        }
        (None, _, Some(Dialog::Write)) => {
            let line = format!("{:<MAX_LINE$}", format!("{}▏", app.line));
            let keys = Span::styled("Enter says it, Esc goes back", theme.dim());
            popup(
                frame,
                theme,
                "to the table",
                vec![plain(&line), Line::from(keys)],
            );
        }
        (None, _, None) => {}
    }
}
